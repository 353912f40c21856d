/* Profiles of lines of text: what a microcontroller prints, said in a TOML file. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "device/lines.h"
#include "device/modbus_profile_read.h"

int tactus_lines_profile_init(tactus_lines_profile *profile)
{
	*profile = (tactus_lines_profile){.baud = 115200, .timeout_s = NAN, .metadata = tactus_metadata_new()};
	return profile->metadata != NULL ? TACTUS_OK : tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
}

void tactus_lines_profile_clear(tactus_lines_profile *profile)
{
	free(profile->name);
	free(profile->description);
	tactus_metadata_free(profile->metadata);
	*profile = (tactus_lines_profile){0};
}

static int read_head(const tactus_toml_node *root, tactus_lines_profile *profile)
{
	const char *kind = NULL, *driver = NULL;
	int code = tactus_toml_string(root, "kind", &kind);
	code = code < 0 ? code : tactus_toml_string(root, "driver", &driver);
	if (code >= 0 && (kind == NULL || strcmp(kind, "profile") != 0 || driver == NULL || strcmp(driver, "lines") != 0))
		return tactus_toml_fail(root, NULL, TACTUS_ERR_INPUT,
								"a profile of lines of text says kind = \"profile\" and driver = \"lines\"");
	code = code < 0 ? code : tactus_bench_format(root);
	code = code < 0 ? code : tactus_profile_text(root, "name", &profile->name);
	return code < 0 ? code : tactus_profile_text(root, "description", &profile->description);
}

static int read_port(const tactus_toml_node *root, tactus_lines_profile *profile)
{
	const char *columns = NULL;
	double baud = profile->baud;
	int code = tactus_toml_number(root, "baud", &baud);
	if (code >= 0 && !(baud >= 50 && baud <= 4e6 && baud == floor(baud)))
		return tactus_toml_fail(root, "baud", TACTUS_ERR_INPUT, "baud = %g is out of range", baud);
	profile->baud = code < 0 ? profile->baud : (int)baud;
	code = code < 0 ? code : tactus_toml_number(root, "timeout_s", &profile->timeout_s);
	code = code < 0 ? code : tactus_toml_string(root, "columns", &columns);
	if (code < 0 || columns == NULL)
		return code;
	profile->has_columns = true;
	code = tactus_lines_parse(columns, &profile->lines);
	return code >= 0 ? code : tactus_toml_fail(root, "columns", TACTUS_ERR_INPUT, "%s", tactus_error_message());
}

int tactus_lines_profile_read(const char *path, tactus_lines_profile *profile)
{
	tactus_toml *document = NULL;
	int code = tactus_toml_read(path, &document);
	if (code < 0)
		return code;
	const tactus_toml_node *root = tactus_toml_root(document);
	code = read_head(root, profile);
	code = code < 0 ? code : read_port(root, profile);
	code = code < 0 ? code : tactus_profile_metadata(root, profile->metadata);
	code = code < 0 ? code : tactus_toml_check_unknown(document);
	tactus_toml_free(document);
	return code < 0 ? code : TACTUS_OK;
}
