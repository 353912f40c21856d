#!/usr/bin/env bats
# The program itself: help, version, unknown words, man pages, completion.
load common

@test "every command is listed, once, and those that scripts know stay" {
	[ "$(commands | sort)" = "$(basename -a "$root"/cli/cmd_*.c | sed 's/^cmd_\(.*\)\.c$/\1/' | sort)" ]
	for c in devices scan convert fit force simulate diagnose show join emulate; do
		commands | grep -qx "$c" || fail "$c is not listed"
	done
}

@test "--version prints the version of the header" {
	version=$(sed -n 's/^#define TACTUS_VERSION "\(.*\)"/\1/p' "$root/include/tactus/version.h")
	[ "$(tactus --version)" = "tactus $version" ]
	for c in $(commands); do [ "$(tactus "$c" --version)" = "tactus $version" ]; done
}

@test "no command: usage on standard error, status 2" {
	run --separate-stderr tactus
	status_is 2
	says "Usage: tactus COMMAND"
	[ -z "$output" ]
}

@test "a mistyped command: status 2 and the nearest one" {
	run --separate-stderr tactus scna
	status_is 2
	says "'scna' is not a command; did you mean 'scan'?"
	run --separate-stderr tactus help covert
	status_is 2
	says "did you mean 'convert'?"
	run --separate-stderr tactus xyzzy
	status_is 2
	[[ $stderr != *"did you mean"* ]]
}

@test "options before the command are refused" {
	run --separate-stderr tactus --quiet scan sim:
	status_is 2
	says "options follow the command"
}

@test "help of every command: status 0, standard output, at most 80 columns, every option and status" {
	for c in "" $(commands); do
		run --separate-stderr tactus $c --help
		status_is 0
		[ -z "$stderr" ]
		wide=$(printf '%s\n' "$output" | LC_ALL=C.UTF-8 awk 'length > 80')
		# An example is one line even where it is long: it is to be pasted.
		wide=$(printf '%s\n' "$wide" | grep -v '^  tactus ' || true)
		[ -z "$wide" ] || fail "$c: wider than 80 columns: $wide"
		[[ $output == *"Exit status"* ]]
		[ -z "$c" ] && continue
		for option in help quiet verbose version; do prints "--$option"; done
	done
}

@test "tactus help COMMAND adds the description to what --help prints" {
	for c in $(commands); do
		short=$(tactus "$c" --help)
		long=$(tactus help "$c")
		[ "${#long}" -gt "${#short}" ]
	done
}

@test "an unknown option: status 2, its name, the nearest one" {
	for c in $(commands); do
		run --separate-stderr tactus "$c" --quieet
		status_is 2
		says "tactus $c: unknown option '--quieet'; did you mean 'quiet'?"
		run --separate-stderr tactus "$c" -Z
		status_is 2
		says "unknown option '-Z'"
	done
}

@test "an option without its value, and a value too many" {
	run --separate-stderr tactus convert --gain-resistor
	status_is 2
	says "--gain-resistor needs"
	run --separate-stderr tactus convert --quiet=yes
	status_is 2
	says "--quiet takes no value"
}

@test "too many arguments, and one too few" {
	run --separate-stderr tactus convert a.csv b.csv
	status_is 2
	says "'b.csv' is one argument too many"
	run --separate-stderr tactus scan
	status_is 2
	says "an argument is missing: URI"
}

@test "options that contradict each other" {
	run --separate-stderr tactus scan sim: -q -v --count 1
	status_is 2
	says "--quiet and --verbose contradict each other"
	run --separate-stderr tactus scan sim: --count 1 --json --format csv
	status_is 2
	says "--json and --format csv contradict each other"
	[ -z "$output" ]
	tactus scan sim: --count 1 --json --format jsonl | tail -1 | jq -e .sequence
	tactus scan sim: -q -v --help >/dev/null
}

@test "quantities: units are understood, anything else is refused with the text and the option" {
	for bad in "10 bananas" "10HzX" "Hz" "" "1e999" "nan" "0x10" "1,5" "10 s"; do
		run --separate-stderr tactus scan sim: --rate "$bad"
		status_is 2
		says "tactus scan: --rate:"
	done
	says "10 s"
	a=$(tactus scan sim: --count 2 --frequency 4kHz)
	b=$(tactus scan sim: --count 2 --frequency 4000)
	[ "$a" = "$b" ]
}

@test "whole numbers: signs, fractions and what is too large are refused" {
	for bad in -1 +1 1.5 1e3 "" abc 99999999999999999999; do
		run --separate-stderr tactus scan sim: --count "$bad"
		status_is 2
		says "tactus scan: --count: '$bad'"
	done
}

@test "choices: the list is printed, and the nearest" {
	run --separate-stderr tactus scan sim: --format cvs
	status_is 2
	says "--format: 'cvs' is none of csv|jsonl; did you mean 'csv'?"
}

@test "--help and --version win over a missing argument" {
	run tactus scan --help
	status_is 0
	run tactus scan --version
	status_is 0
}

@test "man pages: mandoc finds nothing to warn of, and every option is in them" {
	type mandoc >/dev/null || skip "mandoc is not installed"
	for c in "" $(commands); do
		tactus --man $c >page.1
		run mandoc -Tlint -Wwarning page.1
		[ "$status" -eq 0 ] || fail "$c"
		[ -z "$output" ] || fail "$c"
		[ -z "$c" ] && continue
		mandoc -Tutf8 page.1 | sed 's/.\x08//g' >page.txt
		for option in $(tactus "$c" --help | sed -n 's/^ *\(-[a-zA-Z], \)\{0,1\}--\([a-z-]*\).*/\2/p'); do
			grep -q -e "--$option" page.txt || fail "man page of $c has no --$option"
		done
		grep -q "128+n" page.txt
	done
}

@test "--man and --completion of what is not there: status 2" {
	run --separate-stderr tactus --man nosuch
	status_is 2
	run --separate-stderr tactus --completion fish
	status_is 2
	says "bash"
}

# complete WORD…: what bash would offer for the last word.
complete_words() {
	tactus --completion bash >completion
	bash -c '
		source completion
		COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); COMP_LINE="$*"; COMP_POINT=${#COMP_LINE}
		_tactus 2>/dev/null
		printf "%s\n" "${COMPREPLY[@]}"' bash "$@"
}

@test "completion: commands, options, choices, files, devices" {
	[ "$(complete_words tactus si)" = simulate ]
	[ "$(complete_words tactus help jo)" = join ]
	[ "$(complete_words tactus convert --dec)" = --decimal-comma ]
	[ "$(complete_words tactus convert --format j)" = jsonl ]
	[ "$(complete_words tactus fit --effects cr)" = creep ]
	[ "$(complete_words tactus fit --effects hysteresis,cr)" = hysteresis,creep ]
	touch run.csv
	[ "$(complete_words tactus convert ru)" = run.csv ]
	[ "$(complete_words tactus force -m ru)" = run.csv ]
	complete_words tactus scan si | grep -q '^sim:paredes$'
	# readline breaks words at colons: what follows the colon is offered alone
	[ "$(complete_words tactus scan sim : leb)" = lebosse ]
	complete_words tactus scan replay : ru | grep -q '^run.csv$'
	[ -z "$(complete_words tactus scan --rate "")" ]
}

@test "completion passes shellcheck" {
	type shellcheck >/dev/null || skip "shellcheck is not installed"
	tactus --completion bash >completion
	shellcheck -s bash completion
}

@test "no colour and no progress where nothing is a terminal" {
	run --separate-stderr tactus scan sim: --count 3
	[[ $output$stderr != *$'\033'* ]]
}

@test "colour on a terminal, but not with NO_COLOR or TERM=dumb" {
	type script >/dev/null || skip "script(1) is not installed"
	TERM=xterm script -qec "tactus scna" /dev/null >on || true
	grep -q $'\033' on
	NO_COLOR=1 TERM=xterm script -qec "tactus scna" /dev/null >off || true
	if grep -q $'\033' off; then fail "coloured"; fi
	TERM=dumb script -qec "tactus scna" /dev/null >off || true
	if grep -q $'\033' off; then fail "coloured"; fi
	NO_COLOR= TERM=xterm script -qec "tactus scna" /dev/null >on || true
	grep -q $'\033' on
}

@test "every public function is in the list of changes, by its name or its family's" {
	"$PYTHON" - "$root" <<-'EOP'
		import fnmatch, pathlib, re, sys
		root = pathlib.Path(sys.argv[1])
		families = re.findall(r"`(tactus_\w+\*?)`", (root / "CHANGELOG.md").read_text())
		for header in sorted((root / "include/tactus").glob("*.h")):
		    for name in re.findall(r"TACTUS_API[^;]*?\b(tactus_\w+)\(", header.read_text()):
		        of_three = "tactus_fit", "tactus_join", "tactus_diagnos", "tactus_verdict"
		        assert name.startswith(of_three) or any(fnmatch.fnmatchcase(name, f) for f in families), name
	EOP
}
