/* A chain: the base equations of a domain and the effects of one channel, run over blocks of any size. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "model/engine.h"

enum {
	CHUNK = 512, /* samples that are worked on at a time: the signals of a domain then stay in the cache */
	PAD = 8      /* between columns, so that their first samples do not compete for one set of cache lines */
};

typedef struct {
	const tactus_effect *effect;
	double *parameters, *state;
	bool active; /* not neutral */
} link;

struct tactus_chain {
	const tactus_domain *domain;
	double base[TACTUS_PARAMETERS_MAX];
	double *numbers; /* parameters, then the states of all effects, one after the other */
	double *state;
	size_t state_size;
	double *scratch; /* signal_count columns of `capacity` samples */
	size_t capacity;
	double *own[TACTUS_SIGNALS_MAX];   /* those columns */
	double *work[TACTUS_SIGNALS_MAX];  /* what the block in hand is in: these, or the caller's where nothing writes */
	double fill[TACTUS_SIGNALS_MAX];   /* the domain's, close at hand */
	bool reads[TACTUS_SIGNALS_MAX];    /* signals that the caller may give */
	bool constant[TACTUS_SIGNALS_MAX]; /* of them, those that no effect changes: only the input is changed in place */
	bool looks_ahead;                  /* an active effect does */
	size_t count;
	link links[];
};

bool tactus_effect_neutral(const tactus_effect *effect, const double *parameters)
{
	for (size_t i = 0; i < effect->parameter_count; i++)
		if (effect->parameters[i].kind == TACTUS_STRENGTH && parameters[i] != effect->parameters[i].neutral)
			return false;
	return true;
}

static int check_order(const tactus_domain *domain, const tactus_effect *const *effects, size_t count)
{
	for (size_t k = 1; k < count; k++)
		if (effects[k]->stage < effects[k - 1]->stage)
			return tactus_fail(
				TACTUS_ERR_ARGUMENT,
				"effect '%s' (stage %s) must come before '%s' (stage %s): effects are listed in the order "
				"of their stages",
				effects[k]->name, domain->stages[effects[k]->stage].name, effects[k - 1]->name,
				domain->stages[effects[k - 1]->stage].name);
	return TACTUS_OK;
}

/* Makes room for n samples of every signal. */
static int reserve(tactus_chain *chain, size_t n)
{
	if (n <= chain->capacity)
		return TACTUS_OK;
	double *scratch = malloc(chain->domain->signal_count * (n + PAD) * sizeof *scratch);
	if (scratch == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "no memory for a block of %zu samples", n);
	free(chain->scratch);
	chain->scratch = scratch;
	chain->capacity = n;
	for (size_t s = 0; s < chain->domain->signal_count; s++) {
		chain->own[s] = scratch + s * (n + PAD);
		for (size_t i = 0; chain->constant[s] && i < n; i++)
			chain->own[s][i] = chain->fill[s];
	}
	return TACTUS_OK;
}

static int fill_links(tactus_chain *chain, const tactus_effect *const *effects, const double *const *parameters)
{
	size_t numbers = 0;
	for (size_t k = 0; k < chain->count; k++) {
		numbers += effects[k]->parameter_count;
		chain->state_size += effects[k]->state_size;
	}
	chain->numbers = calloc(numbers + chain->state_size + 1, sizeof(double));
	if (chain->numbers == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "no memory for a chain of %zu effects", chain->count);
	chain->state = chain->numbers + numbers;
	double *next = chain->numbers, *state = chain->state;
	for (size_t k = 0; k < chain->count; k++) {
		chain->links[k] = (link){.effect = effects[k], .parameters = next, .state = state};
		next += effects[k]->parameter_count;
		state += effects[k]->state_size;
		tactus_chain_set(chain, (long)k, parameters[k]);
	}
	return TACTUS_OK;
}

int tactus_chain_new(const tactus_domain *domain, const double *base, const tactus_effect *const *effects,
					 const double *const *parameters, size_t count, tactus_chain **result)
{
	int status = check_order(domain, effects, count);
	if (status < 0)
		return status;
	tactus_chain *chain = calloc(1, sizeof *chain + count * sizeof chain->links[0]);
	if (chain == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "no memory for a chain of %zu effects", count);
	chain->domain = domain;
	chain->count = count;
	for (size_t s = 0; s < domain->signal_count; s++) {
		enum tactus_role role = domain->signals[s].role;
		chain->fill[s] = domain->signals[s].fill;
		chain->reads[s] = role != TACTUS_ROLE_INTERNAL && role != TACTUS_ROLE_OUTPUT;
		chain->constant[s] = chain->reads[s] && role != TACTUS_ROLE_INPUT;
	}
	tactus_chain_set(chain, -1, base);
	status = fill_links(chain, effects, parameters);
	if (status == TACTUS_OK)
		status = reserve(chain, CHUNK);
	if (status < 0) {
		tactus_chain_free(chain);
		return status;
	}
	tactus_chain_reset(chain);
	*result = chain;
	return TACTUS_OK;
}

void tactus_chain_free(tactus_chain *chain)
{
	if (chain == NULL)
		return;
	free(chain->numbers);
	free(chain->scratch);
	free(chain);
}

void tactus_chain_set(tactus_chain *chain, long effect, const double *parameters)
{
	if (effect < 0) {
		memcpy(chain->base, parameters, chain->domain->base_count * sizeof *parameters);
		return;
	}
	link *l = &chain->links[effect];
	memcpy(l->parameters, parameters, l->effect->parameter_count * sizeof *parameters);
	l->active = !tactus_effect_neutral(l->effect, parameters);
	chain->looks_ahead = false;
	for (size_t k = 0; k < chain->count; k++)
		if (chain->links[k].active && (chain->links[k].effect->flags & TACTUS_EFFECT_LOOKAHEAD) != 0)
			chain->looks_ahead = true;
}

void tactus_chain_reset(tactus_chain *chain)
{
	for (size_t k = 0; k < chain->count; k++)
		if (chain->links[k].effect->reset != NULL)
			chain->links[k].effect->reset(chain->links[k].parameters, chain->links[k].state);
}

/* Points to what is only read, copies what is changed, and sets the rest to its fill. */
static void load(tactus_chain *chain, size_t first, size_t n, double *const *signal)
{
	for (size_t s = 0; s < chain->domain->signal_count; s++) {
		bool given = chain->reads[s] && signal[s] != NULL;
		double *to = chain->work[s] = given && chain->constant[s] ? signal[s] + first : chain->own[s];
		if (chain->constant[s])
			continue;
		if (n == 1) /* a live reading: not worth a call of memcpy() */
			*to = given ? signal[s][first] : chain->fill[s];
		else if (given)
			memcpy(to, signal[s] + first, n * sizeof *to);
		else
			for (size_t i = 0; i < n; i++)
				to[i] = chain->fill[s];
	}
}

static void store(const tactus_chain *chain, size_t first, size_t n, double *const *signal)
{
	for (size_t s = 0; s < chain->domain->signal_count; s++)
		if (chain->domain->signals[s].role == TACTUS_ROLE_OUTPUT && signal[s] != NULL)
			for (size_t i = 0; i < n; i++)
				signal[s][first + i] = chain->work[s][i];
}

static void compute(tactus_chain *chain, size_t n)
{
	const tactus_domain *domain = chain->domain;
	size_t k = 0;
	for (size_t stage = 0; stage < domain->stage_count; stage++) {
		if (domain->stages[stage].enter != NULL)
			domain->stages[stage].enter(chain->base, n, chain->work);
		for (; k < chain->count && (size_t)chain->links[k].effect->stage == stage; k++)
			if (chain->links[k].active)
				chain->links[k].effect->process(chain->links[k].parameters, chain->links[k].state, n, chain->work);
	}
	if (domain->finish != NULL)
		domain->finish(chain->base, n, chain->work);
}

int tactus_chain_run(tactus_chain *chain, size_t n, double *const *signal)
{
	size_t chunk = chain->looks_ahead ? n : CHUNK;
	int status = reserve(chain, chunk);
	if (status < 0)
		return status;
	for (size_t first = 0; first < n; first += chunk) {
		size_t m = n - first < chunk ? n - first : chunk;
		load(chain, first, m, signal);
		compute(chain, m);
		store(chain, first, m, signal);
	}
	return TACTUS_OK;
}

size_t tactus_chain_state_size(const tactus_chain *chain)
{
	return chain->state_size;
}

double *tactus_chain_state(tactus_chain *chain)
{
	return chain->state;
}
