/* tactus show --effects: the catalogue of causes, from the library's own table. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "show.h"

static void text_line(const char *label, const char *text)
{
	if (!*text)
		return;
	printf("  %-14s ", label);
	cli_wrap(stdout, text, 17, 17);
}

static void print_bound(double bound)
{
	char text[TACTUS_NUMBER_SIZE];
	if (isinf(bound))
		fputs(bound < 0 ? "-∞" : "∞", stdout);
	else if (tactus_format_number(bound, text))
		fputs(text, stdout);
}

static void print_effect(const tactus_effect *effect, const tactus_domain *domain)
{
	printf("%s: domain %s, stage %s\n", tactus_effect_name(effect), tactus_domain_name(domain),
		   tactus_effect_stage(effect));
	text_line("does", tactus_effect_summary(effect));
	text_line("source", tactus_effect_source(effect));
	text_line("mark on", tactus_effect_covariate(effect));
	text_line("needs", tactus_effect_needs(effect));
	text_line("confused with", tactus_effect_confused_with(effect));
	for (size_t i = 0; i < tactus_effect_parameters(effect); i++) {
		tactus_parameter_info p = tactus_effect_parameter(effect, i);
		bool ratio = !*p.unit || !strcmp(p.unit, "1");
		printf("  %s%s%s: ", p.name, ratio ? "" : " in ", ratio ? "" : p.unit);
		print_bound(p.lower);
		fputs(" to ", stdout);
		print_bound(p.upper);
		fputs(", neutral ", stdout);
		print_bound(p.neutral);
		fputs("\n    ", stdout);
		cli_wrap(stdout, p.summary, 4, 4);
	}
}

static void json_effect(struct cli_json *json, const tactus_effect *effect, const tactus_domain *domain)
{
	cli_json_object(json, NULL);
	cli_json_string(json, "name", tactus_effect_name(effect));
	cli_json_string(json, "domain", tactus_domain_name(domain));
	cli_json_string(json, "stage", tactus_effect_stage(effect));
	cli_json_string(json, "summary", tactus_effect_summary(effect));
	cli_json_string(json, "source", tactus_effect_source(effect));
	cli_json_string(json, "covariate", tactus_effect_covariate(effect));
	cli_json_string(json, "needs", tactus_effect_needs(effect));
	cli_json_string(json, "confused_with", tactus_effect_confused_with(effect));
	cli_json_array(json, "parameters");
	for (size_t i = 0; i < tactus_effect_parameters(effect); i++) {
		tactus_parameter_info p = tactus_effect_parameter(effect, i);
		cli_json_object(json, NULL);
		cli_json_string(json, "name", p.name);
		cli_json_string(json, "unit", p.unit);
		cli_json_string(json, "summary", p.summary);
		cli_json_number(json, "neutral", p.neutral);
		cli_json_number(json, "lower", p.lower);
		cli_json_number(json, "upper", p.upper);
		cli_json_close(json);
	}
	cli_json_close(json);
	cli_json_close(json);
}

/* Calls `visit` for every effect (of that name, or all); the number of calls. */
static size_t each_effect(const char *name, void (*visit)(void *, const tactus_effect *, const tactus_domain *),
						  void *context)
{
	size_t found = 0;
	const tactus_domain *domain;
	for (size_t d = 0; (domain = tactus_domain_at(d)); d++)
		for (size_t i = 0; i < tactus_domain_effects(domain); i++) {
			const tactus_effect *effect = tactus_domain_effect(domain, i);
			if (name && strcmp(name, tactus_effect_name(effect)) != 0)
				continue;
			visit(context, effect, domain);
			found++;
		}
	return found;
}

static void visit_json(void *context, const tactus_effect *effect, const tactus_domain *domain)
{
	json_effect(context, effect, domain);
}

static void visit_full(void *context, const tactus_effect *effect, const tactus_domain *domain)
{
	(void)context;
	print_effect(effect, domain);
}

static void visit_line(void *context, const tactus_effect *effect, const tactus_domain *domain)
{
	const tactus_domain **last = context;
	if (*last != domain)
		printf("%s%s:\n", *last ? "\n" : "", tactus_domain_name(domain));
	*last = domain;
	printf("  %-23s %-12s ", tactus_effect_name(effect), tactus_effect_stage(effect));
	cli_wrap(stdout, tactus_effect_summary(effect), 39, 39);
}

static void visit_nothing(void *context, const tactus_effect *effect, const tactus_domain *domain)
{
	(void)context, (void)effect, (void)domain;
}

bool cli_show_effect_is(const char *name)
{
	return each_effect(name, visit_nothing, NULL) > 0;
}

int cli_show_effects(const struct cli *cli, const char *name)
{
	if (name && !cli_show_effect_is(name))
		return cli_error(cli, CLI_USAGE, "'%s' is no effect; `tactus show --effects` lists them", name);
	if (cli_has(cli, "json")) {
		struct cli_json *json = cli_json_begin();
		cli_json_array(json, "effects");
		each_effect(name, visit_json, json);
		return cli_json_end(json);
	}
	const tactus_domain *last = NULL;
	if (name)
		each_effect(name, visit_full, NULL);
	else
		each_effect(NULL, visit_line, &last);
	return CLI_OK;
}
