/* Memory of a model whose equations were generated. */
#ifndef SNARELAB_EQUATIONS_H
#define SNARELAB_EQUATIONS_H

typedef struct {
  double state[N_STATES + 1];
#if FOLLOWS
  double before; /* time and inputs at which state holds; they lag by one step */
  double input_before[N_INPUTS + 1];
#elif STIFF
  double trial; /* length of step to try next [s] */
#endif
} Memory;

typedef struct {
  double work[WORK_SIZE + 1];
} Backend;

#endif
