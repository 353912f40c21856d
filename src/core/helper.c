/* A second thread that lends a hand: runs one function at a time, beside the caller. */
#include <pthread.h>
#include <signal.h>
#include <stdbool.h>
#include <stdlib.h>
#include <unistd.h>

#include "core/helper.h"

struct tactus_helper {
	pthread_t thread;
	pthread_mutex_t mutex;
	pthread_cond_t changed;
	void (*work)(void *context); /* NULL: idle */
	void *context;
	bool stop;
};

static void *run(void *argument)
{
	struct tactus_helper *helper = argument;
	pthread_mutex_lock(&helper->mutex);
	while (!helper->stop) {
		if (!helper->work) {
			pthread_cond_wait(&helper->changed, &helper->mutex);
			continue;
		}
		pthread_mutex_unlock(&helper->mutex);
		helper->work(helper->context); /* changed by nobody while there is work */
		pthread_mutex_lock(&helper->mutex);
		helper->work = NULL;
		pthread_cond_broadcast(&helper->changed);
	}
	pthread_mutex_unlock(&helper->mutex);
	return NULL;
}

struct tactus_helper *tactus_helper_new(void)
{
	struct tactus_helper *helper = sysconf(_SC_NPROCESSORS_ONLN) > 1 ? calloc(1, sizeof *helper) : NULL;
	if (!helper)
		return NULL;
	pthread_mutex_init(&helper->mutex, NULL);
	pthread_cond_init(&helper->changed, NULL);
	/* signals are the caller's business: none is delivered to this thread */
	sigset_t all, before;
	sigfillset(&all);
	pthread_sigmask(SIG_SETMASK, &all, &before);
	int failed = pthread_create(&helper->thread, NULL, run, helper);
	pthread_sigmask(SIG_SETMASK, &before, NULL);
	if (failed) {
		free(helper);
		return NULL;
	}
	return helper;
}

void tactus_helper_start(struct tactus_helper *helper, void (*work)(void *context), void *context)
{
	pthread_mutex_lock(&helper->mutex);
	helper->context = context;
	helper->work = work;
	pthread_cond_broadcast(&helper->changed);
	pthread_mutex_unlock(&helper->mutex);
}

void tactus_helper_wait(struct tactus_helper *helper)
{
	pthread_mutex_lock(&helper->mutex);
	while (helper->work)
		pthread_cond_wait(&helper->changed, &helper->mutex);
	pthread_mutex_unlock(&helper->mutex);
}

void tactus_helper_free(struct tactus_helper *helper)
{
	if (!helper)
		return;
	tactus_helper_wait(helper);
	pthread_mutex_lock(&helper->mutex);
	helper->stop = true;
	pthread_cond_broadcast(&helper->changed);
	pthread_mutex_unlock(&helper->mutex);
	pthread_join(helper->thread, NULL);
	pthread_cond_destroy(&helper->changed);
	pthread_mutex_destroy(&helper->mutex);
	free(helper);
}
