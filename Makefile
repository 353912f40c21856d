# tactus: everything is a target of this file. `make help` lists them.
SHELL := /bin/sh
.DEFAULT_GOAL := all

VERSION := $(shell sed -n 's/^.define TACTUS_VERSION "\(.*\)"/\1/p' include/tactus/version.h)
SOVERSION := 0

BUILD ?= build
PREFIX ?= /usr/local
DESTDIR ?=
BINDIR ?= $(PREFIX)/bin
LIBDIR ?= $(PREFIX)/lib
INCLUDEDIR ?= $(PREFIX)/include
DATADIR ?= $(PREFIX)/share
MANDIR ?= $(DATADIR)/man
COMPLETIONDIR ?= $(DATADIR)/bash-completion/completions

CC ?= gcc
CXX ?= g++
OPT ?= -O2 -g
WARN := -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wno-unknown-warning-option
# `make WERROR=1` turns warnings into errors; CI does.
ifneq ($(WERROR),)
WARN += -Werror
endif
SANITIZE ?=
PACKAGES := jansson tomlplusplus
PKG_CFLAGS := $(shell pkg-config --cflags $(PACKAGES) eigen3 2>/dev/null)
PKG_LIBS := $(shell pkg-config --libs $(PACKAGES) 2>/dev/null)

CPPFLAGS += -Iinclude -D_GNU_SOURCE
COMMON := $(OPT) $(SANITIZE) -fvisibility=hidden -fPIC -pthread -ffp-contract=off
CFLAGS_ALL := -std=c17 $(WARN) -Wstrict-prototypes -Wmissing-prototypes $(COMMON) $(CFLAGS)
CXXFLAGS_ALL := -std=c++17 $(WARN) -Wno-missing-declarations $(COMMON) $(CXXFLAGS)
LDLIBS_LIB := $(PKG_LIBS) -lceres -lglog -lstdc++ -lm -pthread
DEPFLAGS = -MMD -MP

LIB_C := $(wildcard src/*.c src/*/*.c src/*/*/*.c src/*/*/*/*.c)
LIB_CXX := $(wildcard src/*/*.cpp)
LIB_OBJ := $(LIB_C:%.c=$(BUILD)/%.o) $(LIB_CXX:%.cpp=$(BUILD)/%.o)
CLI_C := $(wildcard cli/*.c)
CLI_OBJ := $(CLI_C:%.c=$(BUILD)/%.o)
UNIT_C := $(wildcard tests/unit/test_*.c)
UNIT := $(UNIT_C:tests/unit/%.c=$(BUILD)/tests/%)

SHARED := $(BUILD)/libtactus.so
STATIC := $(BUILD)/libtactus.a

.PHONY: all
all: $(BUILD)/tactus $(SHARED) $(STATIC) ## build the program and the libraries in build/

$(BUILD)/src/%.o: src/%.c
	@mkdir -p $(@D)
	$(CC) $(CPPFLAGS) -Isrc $(PKG_CFLAGS) $(CFLAGS_ALL) $(DEPFLAGS) -c $< -o $@

$(BUILD)/src/%.o: src/%.cpp
	@mkdir -p $(@D)
	$(CXX) $(CPPFLAGS) -Isrc $(patsubst -I%,-isystem %,$(PKG_CFLAGS)) -isystem /usr/include/eigen3 $(CXXFLAGS_ALL) $(DEPFLAGS) -c $< -o $@

$(BUILD)/cli/%.o: cli/%.c
	@mkdir -p $(@D)
	$(CC) $(CPPFLAGS) -Icli $(CFLAGS_ALL) $(DEPFLAGS) -c $< -o $@

$(STATIC): $(LIB_OBJ)
	@rm -f $@
	$(AR) rcs $@ $^

$(SHARED).$(SOVERSION): $(LIB_OBJ) src/tactus.map
	$(CXX) $(OPT) $(SANITIZE) -shared -Wl,-soname,libtactus.so.$(SOVERSION) -Wl,--version-script=src/tactus.map -Wl,--no-undefined -o $@ $(LIB_OBJ) $(LDFLAGS) $(LDLIBS_LIB)

$(SHARED): $(SHARED).$(SOVERSION)
	ln -sf $(<F) $@

# The program links the shared library, as any other user of it would.
$(BUILD)/tactus: $(CLI_OBJ) $(SHARED)
	$(CC) $(OPT) $(SANITIZE) -o $@ $(CLI_OBJ) $(LDFLAGS) -L$(BUILD) -ltactus -Wl,-rpath,'$$ORIGIN' -Wl,-rpath,'$$ORIGIN/../lib' -lm -pthread

# Unit tests link the static library: they may look inside.
$(BUILD)/tests/%: tests/unit/%.c $(STATIC)
	@mkdir -p $(@D)
	$(CC) $(CPPFLAGS) -Isrc -Itests/unit $(PKG_CFLAGS) $(CFLAGS_ALL) $(DEPFLAGS) $< -o $@ $(STATIC) $(LDFLAGS) -lcmocka $(LDLIBS_LIB)

.PHONY: unit
unit: $(UNIT) ## build and run the unit tests
	@for t in $(UNIT); do $$t || exit 1; done

.PHONY: clean
clean: ## remove build/
	rm -rf $(BUILD)

.PHONY: help
help: ## list the targets
	@sed -n 's/^\([a-z_-]*\):.*## \(.*\)/  \1\t\2/p' $(firstword $(MAKEFILE_LIST)) | expand -t 16

-include $(LIB_OBJ:.o=.d) $(CLI_OBJ:.o=.d) $(UNIT:%=%.d)
