// TOML files through toml++: see toml.h. No exception leaves this file.
#include "core/toml.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <toml++/toml.h>

#include "core/core.h"

struct tactus_toml_node {
	tactus_toml *document;
	const toml::node *node;
};

struct tactus_toml {
	std::string name;
	toml::table root;
	std::map<const toml::node *, tactus_toml_node> nodes;
	std::map<const toml::node *, std::vector<std::string>> keys; // of tables, in the file's order
	std::set<std::pair<const toml::node *, std::string>> used;
};

namespace
{

const tactus_toml_node *wrap(tactus_toml *document, const toml::node *node)
{
	return &document->nodes.emplace(node, tactus_toml_node{document, node}).first->second;
}

int fail_at(const tactus_toml *document, const toml::source_region &source, int code, const std::string &text)
{
	return tactus_fail(code, "%s:%u:%u: %s", document->name.c_str(), source.begin.line, source.begin.column,
					   text.c_str());
}

const char *kind_of(const toml::node &node)
{
	switch (node.type()) {
	case toml::node_type::table:
		return "a table";
	case toml::node_type::array:
		return "an array";
	case toml::node_type::string:
		return "a string";
	case toml::node_type::integer:
	case toml::node_type::floating_point:
		return "a number";
	case toml::node_type::boolean:
		return "true or false";
	default:
		return "a date or time";
	}
}

// The value of a key, marked as used; nullptr if it is not there.
const toml::node *lookup(const tactus_toml_node *table, const char *key)
{
	const toml::table *t = table->node->as_table();
	if (!t)
		return nullptr;
	const toml::node *found = t->get(key);
	if (found)
		table->document->used.emplace(table->node, key);
	return found;
}

int wrong_type(const tactus_toml_node *at, const toml::node &node, const std::string &what, const char *wanted)
{
	return fail_at(at->document, node.source(), TACTUS_ERR_INPUT,
				   what + " must be " + wanted + ", not " + kind_of(node));
}

int read_number(const tactus_toml_node *at, const toml::node &node, const std::string &what, double *value)
{
	if (!node.is_number())
		return wrong_type(at, node, what, "a number");
	*value = *node.value<double>();
	if (std::isnan(*value)) // no quantity of a file is that
		return fail_at(at->document, node.source(), TACTUS_ERR_INPUT, what + " must be a number, not nan");
	return 1;
}

int parse(const std::string &name, const std::string &text, tactus_toml **document)
{
	auto made = std::make_unique<tactus_toml>();
	made->name = name;
	try {
		made->root = toml::parse(text, name);
	} catch (const toml::parse_error &error) {
		return fail_at(made.get(), error.source(), TACTUS_ERR_INPUT, std::string(error.description()));
	}
	*document = made.release();
	return TACTUS_OK;
}

// Depth first, in no particular order: the unknown key that stands first in the file.
void first_unknown(const tactus_toml *document, const toml::node &node, const toml::key **first)
{
	if (const toml::table *table = node.as_table()) {
		for (auto &&[key, value] : *table) {
			if (!document->used.count({&node, std::string(key.str())})) {
				if (!*first || key.source().begin < (*first)->source().begin)
					*first = &key;
			} else {
				first_unknown(document, value, first);
			}
		}
	} else if (const toml::array *array = node.as_array()) {
		for (auto &&item : *array)
			first_unknown(document, item, first);
	}
}

} // namespace

extern "C" {

int tactus_toml_parse(const char *name, const char *text, tactus_toml **document)
{
	try {
		return parse(name, text, document);
	} catch (const std::exception &error) {
		return tactus_fail(TACTUS_ERR_INPUT, "%s: %s", name, error.what());
	}
}

int tactus_toml_read(const char *path, tactus_toml **document)
{
	try {
		std::string text;
		if (std::string(path) == "-") {
			text.assign(std::istreambuf_iterator<char>(std::cin), {});
		} else {
			std::error_code unknown;
			if (std::filesystem::is_directory(path, unknown))
				return tactus_fail(TACTUS_ERR_INPUT, "%s: is a directory", path);
			errno = 0;
			std::ifstream file(path, std::ios::binary);
			if (file)
				text.assign(std::istreambuf_iterator<char>(file), {});
			if (!file && errno == ENOENT)
				return tactus_fail(TACTUS_ERR_INPUT, "%s: there is no such file", path);
			if (!file)
				return tactus_fail(TACTUS_ERR_INPUT, "%s: cannot be read%s%s", path, errno ? ": " : "",
								   errno ? std::strerror(errno) : "");
		}
		return parse(path, text, document);
	} catch (const std::exception &error) {
		return tactus_fail(TACTUS_ERR_INPUT, "%s: cannot be read: %s", path, error.what());
	}
}

void tactus_toml_free(tactus_toml *document)
{
	delete document;
}

const tactus_toml_node *tactus_toml_root(const tactus_toml *document)
{
	return wrap(const_cast<tactus_toml *>(document), &document->root);
}

int tactus_toml_table(const tactus_toml_node *node, const char *key, const tactus_toml_node **child)
{
	const toml::node *found = lookup(node, key);
	if (!found)
		return 0;
	if (!found->is_table())
		return wrong_type(node, *found, key, "a table");
	*child = wrap(node->document, found);
	return 1;
}

int tactus_toml_array(const tactus_toml_node *node, const char *key, const tactus_toml_node **child)
{
	const toml::node *found = lookup(node, key);
	if (!found)
		return 0;
	if (!found->is_array())
		return wrong_type(node, *found, key, "an array");
	*child = wrap(node->document, found);
	return 1;
}

size_t tactus_toml_size(const tactus_toml_node *node)
{
	if (const toml::table *table = node->node->as_table())
		return table->size();
	if (const toml::array *array = node->node->as_array())
		return array->size();
	return 0;
}

const tactus_toml_node *tactus_toml_at(const tactus_toml_node *array, size_t i)
{
	const toml::array *a = array->node->as_array();
	return a && i < a->size() ? wrap(array->document, a->get(i)) : nullptr;
}

const char *tactus_toml_key(const tactus_toml_node *table, size_t i)
{
	const toml::table *t = table->node->as_table();
	if (!t || i >= t->size())
		return nullptr;
	std::vector<std::string> &keys = table->document->keys[table->node];
	if (keys.empty()) {
		std::vector<std::pair<toml::source_position, std::string>> order;
		for (auto &&[key, value] : *t)
			order.emplace_back(key.source().begin, std::string(key.str()));
		std::sort(order.begin(), order.end(), [](const auto &a, const auto &b) { return a.first < b.first; });
		for (auto &item : order)
			keys.push_back(std::move(item.second));
	}
	return keys[i].c_str();
}

bool tactus_toml_is(const tactus_toml_node *table, const char *key, char kind)
{
	const toml::table *t = table->node->as_table();
	const toml::node *found = t ? t->get(key) : nullptr;
	if (!found)
		return false;
	switch (kind) {
	case 't':
		return found->is_table();
	case 'a':
		return found->is_array();
	case 'n':
		return found->is_number();
	case 's':
		return found->is_string();
	case 'b':
		return found->is_boolean();
	default:
		return false;
	}
}

int tactus_toml_number(const tactus_toml_node *table, const char *key, double *value)
{
	const toml::node *found = lookup(table, key);
	return found ? read_number(table, *found, key, value) : 0;
}

int tactus_toml_integer(const tactus_toml_node *table, const char *key, long long *value)
{
	const toml::node *found = lookup(table, key);
	if (!found)
		return 0;
	if (!found->is_integer())
		return wrong_type(table, *found, key, "a whole number");
	*value = *found->value<int64_t>();
	return 1;
}

int tactus_toml_bool(const tactus_toml_node *table, const char *key, bool *value)
{
	const toml::node *found = lookup(table, key);
	if (!found)
		return 0;
	if (!found->is_boolean())
		return wrong_type(table, *found, key, "true or false");
	*value = *found->value<bool>();
	return 1;
}

int tactus_toml_string(const tactus_toml_node *table, const char *key, const char **value)
{
	const toml::node *found = lookup(table, key);
	if (!found)
		return 0;
	if (!found->is_string())
		return wrong_type(table, *found, key, "a string");
	*value = found->as_string()->get().c_str();
	return 1;
}

int tactus_toml_item_number(const tactus_toml_node *array, size_t i, double *value)
{
	const tactus_toml_node *item = tactus_toml_at(array, i);
	return item ? read_number(array, *item->node, "the item", value) : 0;
}

int tactus_toml_item_string(const tactus_toml_node *array, size_t i, const char **value)
{
	const tactus_toml_node *item = tactus_toml_at(array, i);
	if (!item)
		return 0;
	if (!item->node->is_string())
		return wrong_type(array, *item->node, "the item", "a string");
	*value = item->node->as_string()->get().c_str();
	return 1;
}

int(tactus_toml_fail)(const tactus_toml_node *node, const char *key, int code, const char *format, ...)
{
	char text[1024];
	va_list arguments;
	va_start(arguments, format);
	vsnprintf(text, sizeof text, format, arguments);
	va_end(arguments);
	const toml::table *table = node->node->as_table();
	const toml::node *at = key && table ? table->get(key) : nullptr;
	return fail_at(node->document, (at ? at : node->node)->source(), code, text);
}

int tactus_toml_check_unknown(const tactus_toml *document)
{
	const toml::key *first = nullptr;
	first_unknown(document, document->root, &first);
	if (!first)
		return TACTUS_OK;
	return fail_at(document, first->source(), TACTUS_ERR_INPUT, "unknown key '" + std::string(first->str()) + "'");
}

} // extern "C"
