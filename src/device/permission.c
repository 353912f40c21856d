/* Device nodes that may not be opened: the udev rules that were installed with the library, or the group of a port. */
#include <dlfcn.h>
#include <grp.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/core.h"
#include "device/permission.h"

#define RULES "60-tactus.rules"

/* Beside the library (PREFIX/lib/libtactus.so, PREFIX/lib/udev/rules.d), then where udev looks anyway. */
static const char *find_rules(char path[PATH_MAX])
{
	static const char *const folders[] = {"/usr/local/lib/udev/rules.d", "/usr/lib/udev/rules.d", "/etc/udev/rules.d"};
	static const char anchor = 0;
	Dl_info library;
	const char *slash = dladdr(&anchor, &library) != 0 ? strrchr(library.dli_fname, '/') : NULL;
	if (slash != NULL &&
		snprintf(path, PATH_MAX, "%.*s/udev/rules.d/" RULES, (int)(slash - library.dli_fname), library.dli_fname) <
			PATH_MAX &&
		access(path, R_OK) == 0)
		return path;
	for (size_t i = 0; i < TACTUS_COUNT(folders); i++) {
		snprintf(path, PATH_MAX, "%s/" RULES, folders[i]);
		if (access(path, R_OK) == 0)
			return path;
	}
	return RULES; /* not installed: it stands in src/device of the source */
}

const char *tactus_permission_remedy(char *text)
{
	char path[PATH_MAX];
	snprintf(text, TACTUS_PERMISSION_SIZE,
			 "install the rules and load them: sudo cp %.300s /etc/udev/rules.d/ && sudo udevadm control --reload && "
			 "sudo udevadm trigger",
			 find_rules(path));
	return text;
}

int tactus_fail_permission(const char *node)
{
	char remedy[TACTUS_PERMISSION_SIZE];
	return tactus_fail(TACTUS_ERR_PERMISSION, "no permission to open %s; %s", node, tactus_permission_remedy(remedy));
}

const char *tactus_permission_port_remedy(const char *node, char *text)
{
	struct stat facts;
	struct group group, *found = NULL;
	char buffer[4096];
	if (stat(node, &facts) == 0 && (facts.st_mode & (S_IRGRP | S_IWGRP)) == (S_IRGRP | S_IWGRP))
		(void)getgrgid_r(facts.st_gid, &group, buffer, sizeof(buffer), &found);
	if (found != NULL)
		snprintf(text, TACTUS_PERMISSION_SIZE,
				 "it belongs to the group %.100s: sudo usermod -aG %.100s $USER, then log in again", found->gr_name,
				 found->gr_name);
	else
		snprintf(text, TACTUS_PERMISSION_SIZE, "no group of users may open it; a udev rule or root can change that");
	return text;
}

int tactus_fail_port_permission(const char *node)
{
	char remedy[TACTUS_PERMISSION_SIZE];
	return tactus_fail(TACTUS_ERR_PERMISSION, "no permission to open %s; %s", node,
					   tactus_permission_port_remedy(node, remedy));
}
