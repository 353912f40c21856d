/* A second thread that lends a hand: runs one function at a time, beside the caller. */
#ifndef TACTUS_HELPER_H
#define TACTUS_HELPER_H

struct tactus_helper;

/* NULL where there is only one processor or no thread can be had: the caller then does all the work itself. */
struct tactus_helper *tactus_helper_new(void);
/* Runs work(context) in the thread; it must be idle. */
void tactus_helper_start(struct tactus_helper *helper, void (*work)(void *context), void *context);
/* Returns when the thread is idle: all it did can be seen then. */
void tactus_helper_wait(struct tactus_helper *helper);
/* Waits, ends the thread and frees; helper may be NULL. */
void tactus_helper_free(struct tactus_helper *helper);

#endif
