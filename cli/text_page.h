/* A page of text: labels in the margin, what they say beside them. */
#ifndef TACTUS_CLI_TEXT_PAGE_H
#define TACTUS_CLI_TEXT_PAGE_H

#include "diagnose.h"

struct page {
	FILE *out;
	const struct cli *cli;
	const tactus_diagnosis *diagnosis;
	const char *extended; /* the file that holds the extended model, or NULL */
	bool coloured;
};

/* An escape sequence, where the page is coloured. */
void page_emphasis(const struct page *page, const char *code);
/* A label in the margin and text beside it, wrapped. */
void page_item(const struct page *page, const char *label, const char *format, ...) TACTUS_PRINTF(3, 4);

/* Text that grows; what does not fit is left out. */
struct words {
	size_t length;
	char text[1024];
};
void words_add(struct words *words, const char *format, ...) TACTUS_PRINTF(2, 3);

#endif
