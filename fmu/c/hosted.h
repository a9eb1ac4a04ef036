/* A model that runs in a Python process of its own, one an instance; this library only talks to it. */
#ifndef SNARELAB_HOSTED_H
#define SNARELAB_HOSTED_H

#include <sys/types.h>

typedef struct {
  double none; /* the process holds the state */
} Memory;

typedef struct {
  int socket;
  pid_t process;
  char resources[4096];
} Backend;

#endif
