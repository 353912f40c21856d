/* A page of text: labels in the margin, what they say beside them. */
#include <stdarg.h>
#include <stdlib.h>

#include "text_page.h"

void page_emphasis(const struct page *page, const char *code)
{
	if (page->coloured)
		fputs(code, page->out);
}

void page_item(const struct page *page, const char *label, const char *format, ...)
{
	enum { LABEL = 11 };
	char *text = NULL;
	va_list values;
	va_start(values, format);
	int n = vasprintf(&text, format, values);
	va_end(values);
	if (n < 0)
		return;
	page_emphasis(page, "\033[1m");
	fprintf(page->out, "%-*s", LABEL, label);
	page_emphasis(page, "\033[m");
	for (char *c = text; *c; c++)
		if (*c == '\n')
			*c = ' ';
	cli_wrap(page->out, text, LABEL, LABEL);
	free(text);
}

void words_add(struct words *words, const char *format, ...)
{
	va_list values;
	va_start(values, format);
	size_t room = sizeof words->text - words->length;
	int n = vsnprintf(words->text + words->length, room, format, values);
	va_end(values);
	if (n > 0)
		words->length += (size_t)n < room ? (size_t)n : room - 1;
}
