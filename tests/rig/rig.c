/* The control sockets of the virtual devices, both ends, and what devices and tests share besides. */
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#include "rig.h"

void rig_die(const char *what)
{
	perror(what);
	exit(1);
}

static struct sockaddr_un address_of(const char *path)
{
	struct sockaddr_un address = {.sun_family = AF_UNIX};
	strncpy(address.sun_path, path, sizeof(address.sun_path) - 1);
	return address;
}

int rig_listen(const char *path)
{
	struct sockaddr_un address = address_of(path);
	int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
	unlink(path);
	if (fd < 0 || bind(fd, (struct sockaddr *)&address, sizeof(address)) != 0 || listen(fd, 8) != 0)
		rig_die(path);
	return fd;
}

/* A line, without its end; what comes after it is not expected. */
static bool read_line(int fd, char *line, size_t size)
{
	size_t n = 0;
	while (n + 1 < size) {
		ssize_t got = read(fd, line + n, size - 1 - n);
		if (got <= 0)
			break;
		n += (size_t)got;
		if (line[n - 1] == '\n')
			break;
	}
	line[n] = 0;
	char *end = strchr(line, '\n');
	if (end == NULL)
		return false;
	*end = 0;
	return true;
}

static bool write_line(int fd, const char *line)
{
	char text[512];
	int n = snprintf(text, sizeof(text), "%s\n", line);
	return n > 0 && (size_t)n < sizeof(text) && write(fd, text, (size_t)n) == n;
}

void rig_serve(int listener, rig_obey *obey, void *context)
{
	int fd = accept(listener, NULL, NULL);
	if (fd < 0)
		rig_die("accept");
	char command[256], answer[400] = "";
	if (read_line(fd, command, sizeof(command))) {
		obey(context, command, answer, sizeof(answer));
		write_line(fd, answer);
	}
	close(fd);
}

const char *rig_tell(const char *path, const char *format, ...)
{
	static char answer[400];
	char command[256];
	va_list arguments;
	va_start(arguments, format);
	vsnprintf(command, sizeof(command), format, arguments);
	va_end(arguments);
	struct sockaddr_un address = address_of(path);
	int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
	if (fd < 0 || connect(fd, (struct sockaddr *)&address, sizeof(address)) != 0)
		rig_die(path);
	if (!write_line(fd, command) || !read_line(fd, answer, sizeof(answer)))
		rig_die(command);
	close(fd);
	return answer;
}

double rig_value(const char *answer, const char *name)
{
	size_t n = strlen(name);
	for (const char *at = answer; (at = strstr(at, name)) != NULL; at += n)
		if ((at == answer || at[-1] == ' ') && at[n] == '=')
			return strtod(at + n + 1, NULL);
	fprintf(stderr, "no %s in: %s\n", name, answer);
	exit(1);
}

int rig_tell_words(const char *path, char *const *words, int n)
{
	char command[256] = "";
	for (int i = 0; i < n; i++) {
		size_t used = strlen(command);
		snprintf(command + used, sizeof(command) - used, "%s%s", i > 0 ? " " : "", words[i]);
	}
	const char *answer = rig_tell(path, "%s", command);
	if (*answer != 0)
		puts(answer);
	return strncmp(answer, "error", 5) == 0 ? 1 : 0;
}

int64_t rig_now_ns(void)
{
	struct timespec t;
	clock_gettime(CLOCK_MONOTONIC, &t);
	return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static void put(uint8_t *at, uint64_t value, int bytes)
{
	for (int i = 0; i < bytes; i++)
		at[i] = (uint8_t)(value >> (8 * i));
}

static uint64_t get(const uint8_t *at, int bytes)
{
	uint64_t value = 0;
	for (int i = 0; i < bytes; i++)
		value |= (uint64_t)at[i] << (8 * i);
	return value;
}

void rig_put16(uint8_t *at, unsigned value)
{
	put(at, value, 2);
}

void rig_put32(uint8_t *at, uint32_t value)
{
	put(at, value, 4);
}

void rig_put64(uint8_t *at, uint64_t value)
{
	put(at, value, 8);
}

unsigned rig_get16(const uint8_t *at)
{
	return (unsigned)get(at, 2);
}

int rig_get16s(const uint8_t *at)
{
	return (int16_t)get(at, 2);
}

uint32_t rig_get32(const uint8_t *at)
{
	return (uint32_t)get(at, 4);
}

uint64_t rig_get64(const uint8_t *at)
{
	return get(at, 8);
}
