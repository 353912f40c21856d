# tactus: everything is a target of this file. `make help` lists them; `make V=1` shows the commands.
SHELL := /bin/sh
.DEFAULT_GOAL := all
.DELETE_ON_ERROR:

VERSION := $(shell sed -n 's/^.define TACTUS_VERSION "\(.*\)"/\1/p' include/tactus/version.h)
SOVERSION := 0

BUILD ?= build
# One spelling of it, relative where it lies inside: the names in dependency files must be those of the targets.
override BUILD := $(patsubst $(CURDIR)/%,%,$(abspath $(BUILD)))
PREFIX ?= /usr/local
DESTDIR ?=
BINDIR ?= $(PREFIX)/bin
LIBDIR ?= $(PREFIX)/lib
INCLUDEDIR ?= $(PREFIX)/include
DATADIR ?= $(PREFIX)/share
MANDIR ?= $(DATADIR)/man
COMPLETIONDIR ?= $(DATADIR)/bash-completion/completions
# One of the places where udev looks, whatever LIBDIR is.
UDEVDIR ?= $(PREFIX)/lib/udev/rules.d

ifeq ($(origin CC),default)
CC := gcc
endif
ifeq ($(origin CXX),default)
CXX := g++
endif
OPT ?= -O2 -g
WARN := -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wno-unknown-warning-option
# `make WERROR=1` turns warnings into errors; CI does.
ifneq ($(WERROR),)
WARN += -Werror
endif
SANITIZE ?=
PACKAGES := jansson tomlplusplus hidapi-hidraw libusb-1.0 libmodbus libserialport libcurl
PKG_CFLAGS := $(shell pkg-config --cflags $(PACKAGES) eigen3 2>/dev/null)
PKG_LIBS := $(strip $(shell pkg-config --libs $(PACKAGES) 2>/dev/null))

CPPFLAGS_ALL := -Iinclude -D_GNU_SOURCE $(CPPFLAGS)
COMMON := $(OPT) $(SANITIZE) -fvisibility=hidden -fPIC -pthread -ffp-contract=off
CFLAGS_ALL := -std=c17 $(WARN) -Wstrict-prototypes -Wmissing-prototypes $(COMMON) $(CFLAGS)
CXXFLAGS_ALL := -std=c++17 $(WARN) -Wno-missing-declarations $(COMMON) $(CXXFLAGS)
LIB_CFLAGS := -Isrc $(PKG_CFLAGS)
# Debian keeps the headers of Dragonbox in a directory with their version.
LIB_CXXFLAGS := -Isrc $(patsubst -I%,-isystem %,$(PKG_CFLAGS)) -isystem /usr/include/eigen3 \
	$(patsubst %,-isystem %,$(lastword $(wildcard /usr/include/dragonbox-*)))
# What a program that links the static library needs besides.
LDLIBS_PRIVATE := $(PKG_LIBS) -lceres -lglog -lstdc++ -lm -pthread
DEPFLAGS = -MMD -MP

LIB_C := $(wildcard src/*.c src/*/*.c src/*/*/*.c src/*/*/*/*.c)
LIB_CXX := $(wildcard src/*/*.cpp)
BENCHES := $(wildcard src/device/benches/*.toml src/device/profiles/*.toml)
LIB_OBJ := $(LIB_C:%.c=$(BUILD)/%.o) $(LIB_CXX:%.cpp=$(BUILD)/%.o) $(BUILD)/src/device/benches.o
CLI_C := $(wildcard cli/*.c)
CLI_OBJ := $(CLI_C:%.c=$(BUILD)/%.o)
UNIT_C := $(wildcard tests/unit/test_*.c)
UNIT := $(UNIT_C:tests/unit/%.c=$(BUILD)/tests/%)
HEADERS := $(wildcard include/tactus/*.h)
PROFILES := $(wildcard src/device/*/*.toml)
RULES := src/device/60-tactus.rules

PROGRAM := $(BUILD)/tactus
SHARED := $(BUILD)/libtactus.so
SONAME := libtactus.so.$(SOVERSION)
STATIC := $(BUILD)/libtactus.a

# Short lines (`CC src/…`), or the commands themselves with V=1.
ifeq ($(V),)
say = @echo '  $(1)	$@';
else
say =
endif
# Goals that go on for a while run in parallel even when nobody says -j; an own -j is respected.
NPROC := $(shell nproc 2>/dev/null || echo 2)
parallel = $(MAKE) --no-print-directory $(if $(filter -j% --jobserver%,$(MAKEFLAGS)),,-j$(NPROC))

.PHONY: all
all: $(PROGRAM) $(SHARED) $(STATIC) $(BUILD)/tactus.pc ## build the program and the libraries in build/

# ---- building ----------------------------------------------------------------------------------------------------

# Rewritten when the flags change, so that what was built with others is built again.
FLAGS := $(CC) $(CXX) $(CPPFLAGS_ALL) $(CFLAGS_ALL) $(CXXFLAGS_ALL) $(LIB_CFLAGS) $(LDFLAGS) $(LDLIBS_PRIVATE)
# The list of objects likewise: a source that was removed leaves the libraries.
$(BUILD)/flags: CONTENT = $(FLAGS)
$(BUILD)/objects: CONTENT = $(LIB_OBJ) $(CLI_OBJ) $(BENCHES)
$(BUILD)/flags $(BUILD)/objects: FORCE
	@mkdir -p $(@D)
	@echo '$(CONTENT)' | cmp -s - $@ || echo '$(CONTENT)' >$@
.PHONY: FORCE
FORCE:

# Says once what is missing instead of a page of compiler errors.
$(BUILD)/packages: Makefile
	@mkdir -p $(@D)
	@{ pkg-config --exists $(PACKAGES) eigen3 && \
		echo '#include <dragonbox/dragonbox.h>' | $(CXX) $(LIB_CXXFLAGS) -std=c++17 -E -x c++ - >/dev/null 2>&1; } || { echo 'Libraries are missing: run scripts/setup first.' >&2; exit 1; }
	@touch $@

$(LIB_OBJ) $(CLI_OBJ): $(BUILD)/flags | $(BUILD)/packages

$(BUILD)/src/%.o: src/%.c
	@mkdir -p $(@D)
	$(call say,CC)$(CC) $(CPPFLAGS_ALL) $(LIB_CFLAGS) $(CFLAGS_ALL) $(DEPFLAGS) -c $< -o $@

$(BUILD)/src/%.o: src/%.cpp
	@mkdir -p $(@D)
	$(call say,CXX)$(CXX) $(CPPFLAGS_ALL) $(LIB_CXXFLAGS) $(CXXFLAGS_ALL) $(DEPFLAGS) -c $< -o $@

# The built-in benches and profiles are in the library, as text.
$(BUILD)/src/device/benches.c: src/device/benches/embed.sh $(BENCHES) $(BUILD)/objects
	@mkdir -p $(@D)
	@sh src/device/benches/embed.sh $(BENCHES) >$@

$(BUILD)/src/device/benches.o: $(BUILD)/src/device/benches.c
	$(call say,CC)$(CC) $(CPPFLAGS_ALL) $(LIB_CFLAGS) $(CFLAGS_ALL) $(DEPFLAGS) -c $< -o $@

# The program sees the public headers only, as any other user of the library would.
$(BUILD)/cli/%.o: cli/%.c
	@mkdir -p $(@D)
	$(call say,CC)$(CC) $(CPPFLAGS_ALL) -Icli $(CFLAGS_ALL) $(DEPFLAGS) -c $< -o $@

$(STATIC): $(LIB_OBJ) $(BUILD)/objects
	@rm -f $@
	$(call say,AR)$(AR) rcs $@ $(LIB_OBJ)

$(BUILD)/$(SONAME): $(LIB_OBJ) $(BUILD)/objects src/tactus.map
	$(call say,LINK)$(CXX) $(OPT) $(SANITIZE) -shared -Wl,-soname,$(SONAME) -Wl,--version-script=src/tactus.map \
		-Wl,--no-undefined -o $@ $(LIB_OBJ) $(LDFLAGS) $(LDLIBS_PRIVATE)

$(SHARED): $(BUILD)/$(SONAME)
	@ln -sf $(<F) $@

LINK_PROGRAM = $(CC) $(OPT) $(SANITIZE) $(CLI_OBJ) $(LDFLAGS) -L$(BUILD) -ltactus -lm -pthread
$(PROGRAM): $(CLI_OBJ) $(SHARED) $(BUILD)/objects
	$(call say,LINK)$(LINK_PROGRAM) -Wl,-rpath,'$$ORIGIN' -o $@

# Unit tests link the static library: they may look inside.
$(BUILD)/tests/%: tests/unit/%.c $(STATIC)
	@mkdir -p $(@D)
	$(call say,TEST)$(CC) $(CPPFLAGS_ALL) $(LIB_CFLAGS) -Itests/unit $(TEST_CFLAGS) $(CFLAGS_ALL) $(DEPFLAGS) $< -o $@ \
		$(STATIC) $(LDFLAGS) -lcmocka $(TEST_LIBS) $(LDLIBS_PRIVATE)

# Suites that bring their own devices: scripts/run-tests puts umockdev between them and the kernel.
$(BUILD)/tests/test_mock_% $(BUILD)/tidy/tests/unit/test_mock_%: TEST_CFLAGS = $(shell pkg-config --cflags umockdev-1.0 | sed 's/-I/-isystem /g')
$(BUILD)/tests/test_mock_%: TEST_LIBS = $(shell pkg-config --libs umockdev-1.0)

# `pkg-config --libs tactus` links the shared library alone, `--static` adds what it is made of.
define PC
prefix=$(PREFIX)
libdir=$(LIBDIR)
includedir=$(INCLUDEDIR)

Name: tactus
Description: Trustworthy readings from low-cost piezoresistive force sensors
Version: $(VERSION)
Cflags: -I$${includedir}
Libs: -L$${libdir} -ltactus
Libs.private: $(LDLIBS_PRIVATE)
endef
export PC
$(BUILD)/tactus.pc: FORCE
	@mkdir -p $(@D)
	@printf '%s\n' "$$PC" | cmp -s - $@ || printf '%s\n' "$$PC" >$@

# ---- trying and testing --------------------------------------------------------------------------------------------

.PHONY: demo
demo: ## the simulated bench from scan to newtons (installs what is missing)
	@scripts/setup
	+@$(parallel) all
	@BUILD=$(BUILD) scripts/demo

.PHONY: test
test: ## build and run all tests (installs what is missing)
	@scripts/setup
	+@$(parallel) all tests
	@scripts/run-tests $(BUILD)

.PHONY: tests
tests: $(UNIT)

.PHONY: unit
unit: $(UNIT) ## the unit tests (cmocka)
	@scripts/run-tests $(BUILD) unit

.PHONY: cli-test
cli-test: all ## the tests of the command line (bats)
	@scripts/run-tests $(BUILD) cli

.PHONY: install-test
install-test: all ## build C and C++ programs against an installed copy and run them
	@scripts/run-tests $(BUILD) install

FAULT_SCANS ?= 1000
.PHONY: faults
faults: all ## spoil the answers of devices behind Modbus, FAULT_SCANS (1000) scans under each fault
	@SCANS=$(FAULT_SCANS) scripts/run-tests $(BUILD) faults

# Of the rig's programs one uses our library, as installed programs do; the others look at USB and HID without it.
RIG_C := $(wildcard tests/rig/*.c)
RIG := $(addprefix $(BUILD)/rig/,virtual_usb virtual_hid test_usb test_hid turn_motor)
RIG_LIBS = $(shell pkg-config --cflags --libs libusb-1.0 hidapi-hidraw)
.PHONY: rig
rig: ## the real programs in a virtual machine, with virtual devices on its USB and HID stacks
	@scripts/setup --rig
	+@$(parallel) all rig-programs
	@scripts/rig $(BUILD)

.PHONY: rig-programs
rig-programs: $(RIG)

$(BUILD)/rig/virtual_usb: tests/rig/virtual_usb.c tests/rig/usbip.c tests/rig/rig.c
$(BUILD)/rig/virtual_hid: $(addprefix tests/rig/,virtual_hid.c virtual_scale.c virtual_motor.c motor_reports.c rig.c)
$(BUILD)/rig/test_usb $(BUILD)/rig/test_hid: $(BUILD)/rig/test_%: tests/rig/test_%.c tests/rig/rig.c
$(BUILD)/rig/turn_motor: tests/rig/turn_motor.c $(HEADERS) $(SHARED)
$(BUILD)/rig/turn_motor: RIG_LIBS = -L$(BUILD) -ltactus -Wl,-rpath,'$$ORIGIN'
$(RIG): $(wildcard tests/rig/*.h)
	@mkdir -p $(@D)
	$(call say,RIG)$(CC) $(CPPFLAGS_ALL) $(CFLAGS_ALL) $(filter %.c,$^) -o $@ $(LDFLAGS) $(RIG_LIBS) -lcmocka -lm

.PHONY: blind
blind: all ## diagnose some two thousand recordings that hide effects and write BLIND.md (an hour)
	@BUILD=$(BUILD) PYTHONDONTWRITEBYTECODE=1 $${PYTHON:-/usr/bin/python3} tests/blind/run.py --suite full --jobs 2

.PHONY: published
published: all ## error reductions on the simulated bench beside the paper's Table I
	@BUILD=$(BUILD) scripts/published

.PHONY: bench
bench: ## speed against Miller, pandas, numpy and scipy, written to BENCHMARKS.md
	@scripts/setup --check
	@BUILD=$(BUILD) scripts/bench

# Loops that the benchmarks call from Python; the static library, because some of them look inside.
$(BUILD)/bench_loops.so: tests/peers/bench_loops.c $(STATIC)
	$(call say,LINK)$(CC) $(CPPFLAGS_ALL) $(LIB_CFLAGS) -std=c17 $(WARN) -O3 -march=native -ffp-contract=off -fPIC -shared $< -o $@ $(STATIC) \
		$(LDFLAGS) $(LDLIBS_PRIVATE)

# What stands before libusb when a stream at full rate is measured.
$(BUILD)/fake_libusb.so: tests/peers/fake_libusb.c
	$(call say,LINK)$(CC) $(CPPFLAGS_ALL) $(PKG_CFLAGS) -std=c17 $(WARN) -O2 -fPIC -shared $< -o $@ -lm

# ---- checking ------------------------------------------------------------------------------------------------------

SOURCES_C := $(LIB_C) $(CLI_C) $(UNIT_C) $(RIG_C) $(wildcard tests/install/*.c tests/peers/*.c tests/fuzz/*.c)
SOURCES := $(SOURCES_C) $(LIB_CXX) $(HEADERS) \
	$(wildcard cli/*.h src/*/*.h src/*/*/*.h src/*/*/*/*.h tests/*/*.h tests/*/*.cpp)
SCRIPTS := $(shell grep -lE '^\#!/bin/(ba)?sh|^\#!/usr/bin/env bash' scripts/* scripts/figures/*.sh tests/rig/*.sh .ci/run 2>/dev/null)

.PHONY: check
check: ## formatting, clang-tidy, cppcheck, shellcheck, headers; any finding is an error
	@scripts/setup --check
	+@$(parallel) check-format check-scripts headers check-cppcheck check-tidy

.PHONY: check-format
check-format:
	@clang-format --dry-run -Werror $(SOURCES)

.PHONY: check-scripts
check-scripts:
	@shellcheck $(SCRIPTS)

# One mark per file, so that an unchanged file is not read again.
TIDY := $(LIB_CXX:%=$(BUILD)/tidy/%) $(SOURCES_C:%=$(BUILD)/tidy/%)
.PHONY: check-tidy
check-tidy: $(TIDY)

TIDY_DEPENDS := .clang-tidy $(HEADERS) $(wildcard src/*/*.h cli/*.h)
$(BUILD)/tidy/%.c: %.c $(TIDY_DEPENDS)
	@mkdir -p $(@D)
	$(call say,TIDY)clang-tidy --quiet $< -- -std=c17 $(CPPFLAGS_ALL) $(LIB_CFLAGS) $(TEST_CFLAGS) -Icli -Wall -Wextra 2>$@.log || { cat $@.log; exit 1; }
	@touch $@

# Without the path-sensitive analyser: on the templates of Eigen and Ceres it takes minutes and finds nothing of ours.
$(BUILD)/tidy/%.cpp: %.cpp $(TIDY_DEPENDS)
	@mkdir -p $(@D)
	$(call say,TIDY)clang-tidy --quiet --checks='-clang-analyzer-*' $< -- -std=c++17 $(CPPFLAGS_ALL) $(LIB_CXXFLAGS) -Wall -Wextra 2>$@.log || { cat $@.log; exit 1; }
	@touch $@

.PHONY: check-cppcheck
check-cppcheck:
	@mkdir -p $(BUILD)/cppcheck
	@cppcheck --quiet --enable=warning,performance,portability --inline-suppr --error-exitcode=1 --std=c17 \
		--cppcheck-build-dir=$(BUILD)/cppcheck --suppress=missingIncludeSystem -D__GNUC__=12 -Iinclude -Isrc -Icli $(LIB_C) $(CLI_C)

# Every public header compiles alone.
.PHONY: headers
headers: ## each public header alone as C11, C17 and C++17, -pedantic -Werror
	@for header in $(HEADERS:include/%=%); do \
		for language in 'c -std=c11' 'c -std=c17' 'c++ -std=c++17'; do \
			printf '#include <%s>\n' "$$header" | $(CC) -Iinclude -x $$language -Wall -Wextra -pedantic -Werror -fsyntax-only - || exit 1; \
		done; \
	done

.PHONY: asan
asan: ## unit and command-line tests under AddressSanitizer and UBSan
	+@$(parallel) BUILD=$(BUILD)/asan OPT='-O1 -g1' WERROR= \
		SANITIZE='-fsanitize=address,undefined -fno-sanitize-recover=all -fno-omit-frame-pointer' sanitized

.PHONY: tsan
tsan: ## the tests that use threads under ThreadSanitizer
	+@$(parallel) BUILD=$(BUILD)/tsan OPT='-O1 -g1' WERROR= SANITIZE='-fsanitize=thread' threaded

.PHONY: sanitized
sanitized: all tests
	@scripts/run-tests $(BUILD) cli unit

THREADED := $(filter $(BUILD)/tests/test_threads $(BUILD)/tests/test_fit%,$(UNIT))
.PHONY: threaded
threaded: $(THREADED)
	@scripts/run-tests $(BUILD) $(THREADED)

# The library is compiled by clang once more, without the shared one and the program. Its C++ is optimised and without
# UBSan, or Eigen makes a diagnosis take four times as long; `make asan` has UBSan in it.
FUZZ_SECONDS ?= 120
FUZZ := $(patsubst tests/fuzz/%.c,$(BUILD)/%,$(wildcard tests/fuzz/fuzz_*.c))
.PHONY: fuzz
fuzz: $(PROGRAM) ## fuzz recordings, models, protocols, the diagnosis and what devices send for FUZZ_SECONDS (120)
	+@$(parallel) BUILD=$(BUILD)/fuzz CC=clang CXX=clang++ OPT='-O1 -gline-tables-only' WERROR= \
		CXXFLAGS='-O2 -fno-sanitize=undefined' \
		SANITIZE='-fsanitize=fuzzer-no-link,address,undefined -fno-sanitize-recover=all -fno-omit-frame-pointer' fuzzers
	@BUILD=$(BUILD) FUZZ_SEED=$(FUZZ_SEED) scripts/fuzz $(FUZZ_SECONDS)

.PHONY: fuzzers
fuzzers: $(FUZZ)

$(BUILD)/fuzz_%: tests/fuzz/fuzz_%.c $(STATIC)
	$(call say,FUZZ)$(CC) $(CPPFLAGS_ALL) $(LIB_CFLAGS) $(CFLAGS_ALL) -fsanitize=fuzzer -fsanitize-link-c++-runtime $(DEPFLAGS) -MF $@.d $< -o $@ $(STATIC) \
		$(LDFLAGS) $(LDLIBS_PRIVATE)

.PHONY: coverage
# -O1: at -O0 the fits' templates take hours. Counts of an earlier run would be added. A failed test does not hide the figures.
coverage: ## run unit and command-line tests with gcov and print what they reach
	@scripts/setup --check
	@find $(BUILD)/coverage -name '*.gcda' -delete 2>/dev/null || true
	+@status=0; $(parallel) BUILD=$(BUILD)/coverage OPT='-O1 -g1' WERROR= SANITIZE='--coverage -fprofile-update=atomic' sanitized || status=$$?; \
	gcovr --root . --filter 'src/' --filter 'cli/' --object-directory $(BUILD)/coverage $(BUILD)/coverage && exit $$status

# ---- documents and installation ------------------------------------------------------------------------------------

# Pages that no option table can hold (the language of protocols) are written by hand beside the code they describe.
COMMANDS := $(patsubst cli/cmd_%.c,%,$(wildcard cli/cmd_*.c))
MAN := $(BUILD)/man/tactus.1 $(COMMANDS:%=$(BUILD)/man/tactus-%.1) \
	$(patsubst %,$(BUILD)/man/%,$(notdir $(wildcard src/*/*.7)))
COMPLETION := $(BUILD)/completion/tactus

.PHONY: docs
docs: $(MAN) $(COMPLETION) ## man pages and bash completion, made by the program from its option tables

$(BUILD)/man/tactus.1: $(PROGRAM)
	@mkdir -p $(@D)
	@$(PROGRAM) --man >$@

$(BUILD)/man/tactus-%.1: $(PROGRAM)
	@mkdir -p $(@D)
	@$(PROGRAM) --man $* >$@

vpath %.7 $(sort $(dir $(wildcard src/*/*.7)))
$(BUILD)/man/%.7: %.7
	@mkdir -p $(@D)
	@cp $< $@

$(COMPLETION): $(PROGRAM)
	@mkdir -p $(@D)
	@$(PROGRAM) --completion bash >$@

# The installed program looks for the library where it was installed, relative to itself.
.PHONY: install
install: all docs ## install to PREFIX (default /usr/local), under DESTDIR if that is set
	@install -d $(addprefix $(DESTDIR),$(BINDIR) $(LIBDIR)/pkgconfig $(INCLUDEDIR)/tactus $(DATADIR)/tactus $(MANDIR) $(COMPLETIONDIR) $(UDEVDIR))
	@$(LINK_PROGRAM) -Wl,-rpath,'$$ORIGIN/$(shell realpath -m --relative-to=$(BINDIR) $(LIBDIR))' -o $(DESTDIR)$(BINDIR)/tactus
	@install -m 644 $(BUILD)/$(SONAME) $(DESTDIR)$(LIBDIR)/libtactus.so.$(VERSION)
	@ln -sf libtactus.so.$(VERSION) $(DESTDIR)$(LIBDIR)/$(SONAME)
	@ln -sf $(SONAME) $(DESTDIR)$(LIBDIR)/libtactus.so
	@install -m 644 $(STATIC) $(DESTDIR)$(LIBDIR)/
	@install -m 644 $(BUILD)/tactus.pc $(DESTDIR)$(LIBDIR)/pkgconfig/
	@install -m 644 $(HEADERS) $(DESTDIR)$(INCLUDEDIR)/tactus/
	@$(if $(PROFILES),install -m 644 $(PROFILES) $(DESTDIR)$(DATADIR)/tactus/)
	@for page in $(MAN); do install -D -m 644 -t $(DESTDIR)$(MANDIR)/man$${page##*.} $$page; done
	@install -m 644 $(COMPLETION) $(DESTDIR)$(COMPLETIONDIR)/
	@install -m 644 $(RULES) $(DESTDIR)$(UDEVDIR)/

.PHONY: uninstall
uninstall: all docs ## remove what install put there, and nothing else
	@rm -f $(addprefix $(DESTDIR),$(BINDIR)/tactus $(COMPLETIONDIR)/tactus $(LIBDIR)/pkgconfig/tactus.pc \
		$(UDEVDIR)/$(notdir $(RULES)) \
		$(addprefix $(LIBDIR)/,libtactus.so.$(VERSION) $(SONAME) libtactus.so libtactus.a) \
		$(HEADERS:include/%=$(INCLUDEDIR)/%) $(addprefix $(DATADIR)/tactus/,$(notdir $(PROFILES))))
	@for page in $(MAN); do rm -f $(DESTDIR)$(MANDIR)/man$${page##*.}/$${page##*/}; done
	@for d in $(INCLUDEDIR)/tactus $(DATADIR)/tactus; do rmdir $(DESTDIR)$$d 2>/dev/null || true; done

.PHONY: clean
clean: ## remove build/
	rm -rf $(BUILD)

.PHONY: help
help: ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  \1\t\2/p' $(firstword $(MAKEFILE_LIST)) | expand -t 18
	@echo 'Variables: BUILD=$(BUILD) PREFIX=$(PREFIX) DESTDIR CC CXX OPT CFLAGS WERROR=1 V=1'

-include $(LIB_OBJ:.o=.d) $(CLI_OBJ:.o=.d) $(UNIT:%=%.d) $(FUZZ:%=%.d)
