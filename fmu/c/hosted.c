/* Talk to resources/host.py over a socket. The Python there is never loaded into this process: what fails in it, and even
   its death, becomes an error status here; models never share a module; no library of Python's need be found by the
   importer. A message is a code and a length, 32 bits each, and the payload; an answer's code is a Status, and the payload
   of one that is not OK says why. */
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

extern char **environ;

enum { HELLO, INITIALIZE, STEP, OUTPUTS, SAVE, RESTORE };

static int send_all(int socket, const void *data, size_t size) {
  const char *at = data;
  while (size) {
    ssize_t n = send(socket, at, size, MSG_NOSIGNAL);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return 0;
    at += n;
    size -= (size_t)n;
  }
  return 1;
}

static int receive_all(int socket, void *data, size_t size) {
  char *at = data;
  while (size) {
    ssize_t n = recv(socket, at, size, 0);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return 0;
    at += n;
    size -= (size_t)n;
  }
  return 1;
}

/* Wait for the process to end, a while; how it ended, in words. */
static void bury(Instance *i, char *words, size_t size) {
  int how = 0;
  const struct timespec moment = {0, 2000000};
  snprintf(words, size, "it had to be stopped");
  if (i->backend.process <= 0) return;
  for (int n = 0; n < 5000; ++n) { /* its warden gives the model a second, and ends what it has left */
    pid_t ended = waitpid(i->backend.process, &how, WNOHANG);
    if (ended != 0) {
      if (ended > 0 && WIFSIGNALED(how)) snprintf(words, size, "it was ended by signal %d", WTERMSIG(how));
      else if (ended > 0) snprintf(words, size, "it ended with status %d", WEXITSTATUS(how));
      i->backend.process = 0;
      return;
    }
    nanosleep(&moment, NULL);
  }
  kill(i->backend.process, SIGKILL);
  waitpid(i->backend.process, &how, 0);
  i->backend.process = 0;
}

/* Send a message of up to three parts and receive the answer; `answer` is malloc'ed, and the caller frees it. */
static Status ask(Instance *i, uint32_t code, const void *const *part, const size_t *size, int n, unsigned char **answer,
                  size_t *answered) {
  uint32_t head[2] = {code, 0};
  int alive = i->backend.socket >= 0;
  *answer = NULL;
  *answered = 0;
  for (int k = 0; k < n; ++k) head[1] += (uint32_t)size[k];
  alive = alive && send_all(i->backend.socket, head, sizeof head);
  for (int k = 0; alive && k < n; ++k) alive = send_all(i->backend.socket, part[k], size[k]);
  alive = alive && receive_all(i->backend.socket, head, sizeof head);
  if (alive) {
    *answer = malloc((size_t)head[1] + 1);
    alive = *answer && receive_all(i->backend.socket, *answer, head[1]);
  }
  if (!alive) {
    char words[64] = "it ended before";
    free(*answer);
    *answer = NULL;
    if (i->backend.socket >= 0) {
      close(i->backend.socket);
      i->backend.socket = -1;
      bury(i, words, sizeof words);
    }
    return say(i, STATUS_ERROR, "the Python process of this model is gone: %s", words);
  }
  (*answer)[head[1]] = 0;
  *answered = head[1];
  if (!head[0]) return STATUS_OK;
  say(i, head[0] == STATUS_DISCARD ? STATUS_DISCARD : STATUS_ERROR, "%s", (char *)*answer);
  free(*answer);
  *answer = NULL;
  return head[0] == STATUS_DISCARD ? STATUS_DISCARD : STATUS_ERROR;
}

/* First line of resources/python.txt, unless the environment names another interpreter. */
static int interpreter(Instance *i, const char *resources, char *python, size_t size) {
  const char *named = getenv("SNARELAB_PYTHON");
  char path[4200];
  if (named && *named) {
    snprintf(python, size, "%s", named);
    return 1;
  }
  snprintf(path, sizeof path, "%s/python.txt", resources);
  FILE *file = fopen(path, "r");
  int read = file && fgets(python, (int)size, file);
  if (file) fclose(file);
  if (!read) {
    say(i, STATUS_ERROR, "%s cannot be read; was the FMU unpacked whole, and its resources' place given?", path);
    return 0;
  }
  python[strcspn(python, "\r\n")] = 0;
  return 1;
}

/* An importer may run without descriptors 0 to 2, as daemons do. A socket must not take one of them: the child would find
   this end of it among its standard streams, and wait for itself to hang up. */
static int above_standard(int descriptor) {
  if (descriptor > 2) return descriptor;
  const int moved = fcntl(descriptor, F_DUPFD_CLOEXEC, 3);
  close(descriptor);
  return moved;
}

/* A session of its own, so that Ctrl-C is the importer's alone; no signal blocked or ignored that its warden needs. */
static void detach(posix_spawnattr_t *attributes) {
  sigset_t none, children;
  short flags = POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF;
  sigemptyset(&none);
  sigemptyset(&children);
  sigaddset(&children, SIGCHLD);
#ifdef POSIX_SPAWN_SETSID
  flags |= POSIX_SPAWN_SETSID;
#else
  flags |= POSIX_SPAWN_SETPGROUP;
#endif
  posix_spawnattr_init(attributes);
  posix_spawnattr_setsigmask(attributes, &none);
  posix_spawnattr_setsigdefault(attributes, &children);
  posix_spawnattr_setflags(attributes, flags);
}

/* What the model prints goes to the importer's standard error: its output is its own. */
static void connect_streams(posix_spawn_file_actions_t *actions, int socket) {
  posix_spawn_file_actions_init(actions);
  posix_spawn_file_actions_adddup2(actions, socket, 0);
  if (fcntl(2, F_GETFD) < 0) posix_spawn_file_actions_addopen(actions, 2, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_adddup2(actions, 2, 1);
}

static Status start_process(Instance *i) {
  char python[4096], script[4200], importer[24], **environment = environ;
  const char *folder = i->backend.resources;
  int pair[2], n = 0, kept = 0;
  if (!interpreter(i, folder, python, sizeof python)) return STATUS_ERROR;
  snprintf(script, sizeof script, "%s/host.py", folder);
  snprintf(importer, sizeof importer, "%ld", (long)getpid());
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair))
    return say(i, STATUS_ERROR, "no socket for the Python process: %s", strerror(errno));
  for (int k = 0; k < 2; ++k) pair[k] = above_standard(pair[k]);
  if (pair[0] < 0 || pair[1] < 0) {
    for (int k = 0; k < 2; ++k)
      if (pair[k] >= 0) close(pair[k]);
    return say(i, STATUS_ERROR, "no descriptor left for the Python process: %s", strerror(errno));
  }
  while (environment && environment[n]) ++n;
  char **clean = calloc((size_t)n + 2, sizeof *clean); /* another Python's settings would mislead this one */
  for (int k = 0; clean && k < n; ++k)
    if (strncmp(environment[k], "PYTHON", 6) && strncmp(environment[k], "OMP_NUM_THREADS=", 16)) clean[kept++] = environment[k];
  if (clean) clean[kept] = "OMP_NUM_THREADS=1";
  posix_spawn_file_actions_t actions;
  posix_spawnattr_t attributes;
  connect_streams(&actions, pair[1]);
  detach(&attributes);
  char *arguments[] = {python, "-u", script, importer, NULL};
  int failed = clean ? posix_spawn(&i->backend.process, python, &actions, &attributes, arguments, clean) : ENOMEM;
  posix_spawn_file_actions_destroy(&actions);
  posix_spawnattr_destroy(&attributes);
  free(clean);
  close(pair[1]);
  i->backend.socket = pair[0];
  if (failed) {
    i->backend.process = 0;
    return say(i, STATUS_ERROR, "the interpreter %s cannot be started: %s; name another in SNARELAB_PYTHON, or export again",
               python, strerror(failed));
  }
  unsigned char *answer;
  size_t answered;
  const size_t size = sizeof MODEL_TOKEN - 1;
  const void *token = MODEL_TOKEN;
  Status status = ask(i, HELLO, &token, &size, 1, &answer, &answered);
  free(answer);
  return status;
}

static Status backend_open(Instance *i, const char *resources) {
  size_t length = strlen(resources);
  i->backend.socket = -1;
  while (length > 1 && resources[length - 1] == '/') --length;
  snprintf(i->backend.resources, sizeof i->backend.resources, "%.*s", (int)length, resources);
  return start_process(i);
}

static void backend_close(Instance *i) {
  char words[64];
  if (i->backend.socket >= 0) close(i->backend.socket);
  i->backend.socket = -1;
  bury(i, words, sizeof words);
}

/* A new process where the last one has died. */
static Status backend_reset(Instance *i) {
  struct pollfd hung = {i->backend.socket, 0, 0};
  if (i->backend.socket >= 0 && poll(&hung, 1, 0) == 0) return STATUS_OK;
  backend_close(i);
  return start_process(i);
}

static void backend_tolerance(Instance *i, double tolerance) { (void)i, (void)tolerance; } /* a participant has none */

/* Ask, and take the answer for the outputs. */
static Status ask_outputs(Instance *i, uint32_t code, const void *const *part, const size_t *size, int n) {
  unsigned char *answer;
  size_t answered;
  Status status = ask(i, code, part, size, n, &answer, &answered);
  if (status) return status;
  if (answered == N_OUTPUTS * sizeof(double)) {
    memcpy(i->output, answer, answered);
    i->fresh = 1;
  } else {
    status = say(i, STATUS_ERROR, "the Python process answered %zu bytes for %d outputs", answered, N_OUTPUTS);
  }
  free(answer);
  return status;
}

#define DOUBLES(n) ((size_t)(n) * sizeof(double))

static Status backend_initialize(Instance *i) {
  const void *part[] = {&i->now.time, i->now.parameter, i->now.input};
  const size_t size[] = {DOUBLES(1), DOUBLES(N_PARAMETERS), DOUBLES(N_INPUTS)};
  unsigned char *answer;
  size_t answered;
  Status status = ask(i, INITIALIZE, part, size, 3, &answer, &answered);
  free(answer);
  return status;
}

static Status backend_step(Instance *i, double size_of_step) {
  const double when[] = {i->now.time, size_of_step};
  const void *part[] = {when, i->now.input, i->now.slope};
  const size_t size[] = {DOUBLES(2), DOUBLES(N_INPUTS), DOUBLES(N_INPUTS)};
  return ask_outputs(i, STEP, part, size, 3);
}

static Status backend_outputs(Instance *i) {
  const void *part[] = {i->now.input};
  const size_t size[] = {DOUBLES(N_INPUTS)};
  return ask_outputs(i, OUTPUTS, part, size, 1);
}

static Status backend_derivative(Instance *i, const double *by_input, const double *by_parameter, double *output) {
  (void)by_input, (void)by_parameter, (void)output;
  return say(i, STATUS_ERROR, "directional derivatives are not provided");
}

static Status backend_save(Instance *i, unsigned char **bytes, size_t *size) {
  return i->now.ready ? ask(i, SAVE, NULL, NULL, 0, bytes, size) : STATUS_OK;
}

static Status backend_restore(Instance *i, const unsigned char *bytes, size_t size) {
  if (!size) return STATUS_OK; /* saved before there was a state */
  const void *part[] = {&i->now.start, i->now.parameter, bytes};
  const size_t sizes[] = {DOUBLES(1), DOUBLES(N_PARAMETERS), size};
  return ask_outputs(i, RESTORE, part, sizes, 3);
}
