/* How METIS reports that it ran out of memory, without signals.
 *
 * The library's own version of these functions (GKlib/error.c) takes over SIGTERM and SIGABRT of the whole process while a matrix is ordered, and
 * jumps out of the handler through a buffer of the thread that runs it. A server that was told to stop in that moment died of a segmentation
 * fault, since the signal came to another thread. Here the jump is made where the error is, and no signal takes part. The linker takes the
 * first definition that it needs, and this object is needed before the one of the library: see ordering.rs. All names of that object are
 * here, so that nothing else asks for it. */

#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MAX_JBUFS 128

__thread int gk_cur_jbufs = -1;
__thread jmp_buf gk_jbufs[MAX_JBUFS];
__thread jmp_buf gk_jbuf;

/* Called before METIS is, so that this object is part of the program. */
void chladni_metis_errors(void) {}

void gk_set_exit_on_error(int value) { (void)value; }

void gk_sigthrow(int signum) {
  if (gk_cur_jbufs < 0 || gk_cur_jbufs >= MAX_JBUFS)
    abort();
  longjmp(gk_jbufs[gk_cur_jbufs], signum);
}

/* What METIS would print is no news for the log of a server: the caller gets a status. The number says which one, and is not sent. */
void errexit(char *f_str, ...) {
  (void)f_str;
  gk_sigthrow(SIGTERM);
}

void gk_errexit(int signum, char *f_str, ...) {
  (void)f_str;
  gk_sigthrow(signum);
}

int gk_sigtrap(void) {
  if (gk_cur_jbufs + 1 >= MAX_JBUFS)
    return 0;
  gk_cur_jbufs++;
  return 1;
}

int gk_siguntrap(void) {
  if (gk_cur_jbufs == -1)
    return 0;
  gk_cur_jbufs--;
  return 1;
}

void gk_SetSignalHandlers(void) {}
void gk_UnsetSignalHandlers(void) {}
void gk_NonLocalExit_Handler(int signum) { longjmp(gk_jbuf, signum); }

char *gk_strerror(int errnum) {
  static __thread char text[32];
  snprintf(text, sizeof text, "error %d", errnum);
  return text;
}

void PrintBackTrace(void) {}
