/* tactus --completion bash: the completion script, made from the option tables. */
#include <stdio.h>
#include <string.h>

#include "internal.h"

/* Words of a choice, one by one with blanks between. */
static void words(FILE *out, const char *choices)
{
	for (; *choices; choices++)
		fputc(*choices == '|' ? ' ' : *choices, out);
}

static void effects(FILE *out)
{
	const tactus_domain *domain;
	for (size_t d = 0; (domain = tactus_domain_at(d)); d++)
		for (size_t i = 0; i < tactus_domain_effects(domain); i++)
			fprintf(out, "%s ", tactus_effect_name(tactus_domain_effect(domain, i)));
}

/* Cases "command:--option)" for what the argument of an option can be. */
static void option_cases(FILE *out, const struct cli_command *command)
{
	const struct cli_option *option;
	for (size_t i = 0; (option = cli_option_at(command, i)); i++) {
		if (option->kind == CLI_FLAG)
			continue;
		fprintf(out, "\t%s:--%s", command->name, option->name);
		if (option->letter)
			fprintf(out, " | %s:-%c", command->name, option->letter);
		fputs(") ", out);
		if (option->kind == CLI_FILE) {
			fputs("_tactus_files", out);
		} else if (option->kind == CLI_CHOICE) {
			fputs("_tactus_words \"", out);
			words(out, option->unit);
			fputc('"', out);
		} else if (!strcmp(option->name, "effects")) {
			fputs("_tactus_list \"", out);
			effects(out);
			fputc('"', out);
		} else {
			fputc(':', out);
		}
		fputs("; return ;;\n", out);
	}
}

static void options_of(FILE *out, const struct cli_command *command)
{
	fprintf(out, "\t%s) options=\"", command->name);
	const struct cli_option *option;
	for (size_t i = 0; (option = cli_option_at(command, i)); i++)
		fprintf(out, "%s--%s", i ? " " : "", option->name);
	fputs("\" ;;\n", out);
}

void cli_completion_bash(FILE *out)
{
	fputs(
		"# bash completion of tactus; made by `tactus --completion bash`.\n"
		"_tactus_words() { mapfile -t COMPREPLY < <(compgen -W \"$1\" -- \"$word\"); }\n"
		"# One word of several with commas between.\n"
		"_tactus_list() {\n"
		"\tlocal before=\n"
		"\t[[ $word == *,* ]] && before=${word%,*},\n"
		"\tmapfile -t COMPREPLY < <(compgen -P \"$before\" -W \"$1\" -- \"${word##*,}\")\n"
		"\tcompopt -o nospace 2>/dev/null\n"
		"}\n"
		"_tactus_files() {\n"
		"\tcompopt -o filenames 2>/dev/null\n"
		"\tmapfile -t COMPREPLY < <(compgen -f -- \"$word\")\n"
		"}\n"
		"# URIs hold colons, at which readline breaks words: only what follows the last one is offered.\n"
		"_tactus_uris() {\n"
		"\tlocal uri=$word\n"
		"\t[[ $word == : ]] && uri=\"$previous:\"\n"
		"\t[[ $previous == : ]] && uri=\"${COMP_WORDS[COMP_CWORD - 2]}:$word\"\n"
		"\tmapfile -t COMPREPLY < <(compgen -W \"$(tactus devices 2>/dev/null | cut -d' ' -f1) replay:\" -- \"$uri\")\n"
		"\tCOMPREPLY=(\"${COMPREPLY[@]#\"${uri%\"${uri##*:}\"}\"}\")\n"
		"\t[[ $uri == replay:* || ${#COMPREPLY[@]} -eq 0 ]] && word=${uri#*:} && _tactus_files\n"
		"\tcompopt -o nospace 2>/dev/null\n"
		"}\n"
		"_tactus() {\n"
		"\tlocal word=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD - 1]} command=${COMP_WORDS[1]} "
		"options=\n"
		"\tif [[ $COMP_CWORD -eq 1 || ($COMP_CWORD -eq 2 && $command == help) ]]; then\n"
		"\t\t_tactus_words \"",
		out);
	for (const struct cli_command *const *c = cli_commands; *c; c++)
		fprintf(out, "%s ", (*c)->name);
	fputs("help --help --version\"\n\t\treturn\n\tfi\n\tcase $command:$previous in\n", out);
	for (const struct cli_command *const *c = cli_commands; *c; c++)
		option_cases(out, *c);
	fputs("\tesac\n\tcase $command in\n", out);
	for (const struct cli_command *const *c = cli_commands; *c; c++)
		options_of(out, *c);
	fputs("\tesac\n\tif [[ $word == -* ]]; then\n\t\t_tactus_words \"$options\"\n\telif false; then\n\t\t:\n", out);
	for (const struct cli_command *const *c = cli_commands; *c; c++)
		if (!strncmp((*c)->arguments, "URI", 3))
			fprintf(out, "\telif [[ $command == %s ]]; then\n\t\t_tactus_uris\n", (*c)->name);
	fputs("\telse\n\t\t_tactus_files\n\tfi\n}\ncomplete -F _tactus tactus\n", out);
}
