#!/usr/bin/env bats
# Bad input on every command that reads a recording: status 3, a clear message with FILE:LINE, nothing written.
load common

readers="convert fit force simulate show diagnose"

# bad FILE [WHERE]: every reader refuses FILE, naming WHERE (default: the file), and leaves no output behind.
bad() {
	for c in $readers; do
		# shellcheck disable=SC2046  # options are meant to split
		case $c in
		show) run --separate-stderr tactus show "$1" ;;
		*) run --separate-stderr tactus "$c" $(needs "$c") "$1" -o out ;;
		esac
		status_is 3
		says "tactus $c: ${2:-$1}"
		[ ! -e out ] || fail "$c left its output"
		[ -z "$(find . -name '*out*')" ] || fail "$c left a file: $(find . -name '*out*')"
	done
	run --separate-stderr tactus join "$1" good.csv -o out
	status_is 3
	says "tactus join: ${2:-$1}"
	run --separate-stderr tactus join good.csv "$1" -o out
	status_is 3
	[ ! -e out ]
}

@test "no such file, a directory, a file without permission" {
	recording >good.csv
	bad nosuch.csv
	mkdir dir
	bad dir
	if [ "$(id -u)" -ne 0 ]; then
		recording >secret.csv
		chmod 0 secret.csv
		bad secret.csv
	fi
}

@test "an empty file" {
	recording >good.csv
	: >empty.csv
	bad empty.csv
}

@test "metadata and nothing else" {
	recording >good.csv
	echo "# device: x" >only.csv
	bad only.csv
}

@test "a word where a number belongs, with its line" {
	recording | sed '5s/,[^,]*$/,abc/' >word.csv
	recording >good.csv
	bad word.csv word.csv:5
	says abc
}

@test "NaN and infinity, with their line" {
	recording >good.csv
	for bad in nan NaN inf -Infinity; do
		recording | sed "7s/,[^,]*\$/,$bad/" >nan.csv
		bad nan.csv nan.csv:7
	done
}

@test "a row with a field too few, and one too many" {
	recording >good.csv
	recording | sed '4s/,[^,]*$//' >short.csv
	bad short.csv short.csv:4
	recording | sed '9s/$/,1/' >long.csv
	bad long.csv long.csv:9
}

@test "truncated in the middle of its last row" {
	recording >good.csv
	recording | head -c -12 | sed '$s/,[^,]*$//' >cut.csv
	bad cut.csv cut.csv:
}

@test "a column twice" {
	recording >good.csv
	recording | sed '1s/channel/time_s/' >twice.csv
	bad twice.csv twice.csv:1
	says time_s
}

@test "binary garbage" {
	recording >good.csv
	head -c 5000 /dev/zero | tr '\0' '\1\2\377' >garbage.csv
	recording | sed '2s/$/\x00/' >nul.csv
	bad garbage.csv
	bad nul.csv nul.csv:2
}

@test "a line of ten million characters" {
	recording >good.csv
	{
		recording 3
		head -c 10000000 /dev/zero | tr '\0' x
		echo
	} >huge.csv
	bad huge.csv huge.csv:8
	[ ${#stderr} -lt 1000 ]
}

@test "the header in the middle of a file" {
	recording >good.csv
	{
		recording 3
		recording 3
	} >two.csv
	bad two.csv two.csv:8
	says "the header is here again"
}

@test "a column that is needed and not there is named, with the header's line" {
	{
		echo "# a remark"
		recording | cut -d, -f1-4,6-7
	} >lacking.csv
	for c in fit force diagnose; do
		# shellcheck disable=SC2046
		run --separate-stderr tactus "$c" $(needs "$c") lacking.csv
		status_is 3
		says "lacking.csv:2: no column 'conductance_S'"
	done
	run --separate-stderr tactus convert -g 1kohm lacking.csv
	status_is 3
	says "lacking.csv:2: no column amplitude_V"
	run --separate-stderr tactus convert -w csv -g 1kohm --drive 1V --frequency 4kHz lacking.csv
	status_is 3
	says "lacking.csv:2: no column sample_V"
	run --separate-stderr tactus scan replay:lacking.csv
	status_is 3
	says "lacking.csv:2: neither amplitude_V"
	run --separate-stderr tactus scan sim: --loads lacking.csv
	status_is 3
	says "lacking.csv:2: loads are columns"
	recording | cut -d, -f1-3,5- >unloaded.csv
	run --separate-stderr tactus simulate -m "$examples/model-forward.toml" unloaded.csv
	status_is 3
	says "unloaded.csv:1: no column 'force_N'"
}

@test "a reading that goes bad half way: the message has the line, and -o leaves nothing" {
	recording 20000 | sed '30000s/,[^,]*$/,oops/' >late.csv
	recording >good.csv
	bad late.csv late.csv:30000
}

@test "CRLF, a byte order mark and no newline at the end read like any other file" {
	recording >plain.csv
	sed 's/$/\r/' plain.csv >crlf.csv
	{ printf '\357\273\277'; cat plain.csv; } >bom.csv
	head -c -1 plain.csv >open.csv
	want=$(tactus force -m "$examples/model-forward.toml" plain.csv)
	for f in crlf bom open; do
		[ "$(tactus force -m "$examples/model-forward.toml" $f.csv)" = "$want" ]
	done
}

@test "JSON Lines that do not parse: FILE:LINE" {
	recording >good.csv
	tactus simulate -m "$examples/model-forward.toml" good.csv --json >good.jsonl
	sed '3s/"time_s":[^,]*/"time_s":/' good.jsonl >broken.jsonl
	bad broken.jsonl broken.jsonl:3
	sed '2s/"amplitude_V":[^,}]*/"amplitude_V":"two"/' good.jsonl >word.jsonl
	bad word.jsonl word.jsonl:2
}

@test "a locale with a decimal comma changes nothing" {
	recording >run.csv
	locales=$(locale -a)
	if grep -qx 'de_DE.utf8' <<<"$locales"; then
		export LC_ALL=de_DE.utf8
	elif type localedef >/dev/null && [ -e /usr/share/i18n/locales/de_DE ]; then
		localedef -i de_DE -f UTF-8 ./de_DE.utf8
		export LOCPATH=$PWD LC_ALL=de_DE.utf8
	else
		skip "no locale with a decimal comma here"
	fi
	[ "$(env printf '%.1f' 0,5)" = 0,5 ]
	export ASAN_OPTIONS="${ASAN_OPTIONS:-}:detect_leaks=0" # the C library keeps what it made of LOCPATH
	with=$(tactus force -m "$examples/model-forward.toml" run.csv)
	[ "$with" = "$(LC_ALL=C tactus force -m "$examples/model-forward.toml" run.csv)" ]
	run --separate-stderr tactus scan sim: --rate 2.5Hz --count 1
	status_is 0
	run --separate-stderr tactus scan sim: --rate 2,5Hz --count 1
	status_is 2
}

@test "a model file that is none, or is wrong: FILE:LINE:COLUMN" {
	recording >run.csv
	printf 'kind = "model"\nformat = 1\ndomain = "sensor"\nnonsense = 3\n[output.conductance_S]\n[[channel]]\nchannel = 1\nbase = { g0 = 0.0, g1 = 1e-6 }\n' >odd.toml
	sed 's/nonsense = 3/form = 3/' odd.toml >type.toml
	echo 'kind = ' >broken.toml
	for c in force simulate "scan sim:"; do
		run --separate-stderr tactus $c -m nosuch.toml
		status_is 3
		says "nosuch.toml: there is no such file"
		run --separate-stderr tactus $c -m odd.toml
		status_is 3
		says odd.toml:4:1
		run --separate-stderr tactus $c -m type.toml
		status_is 3
		says type.toml:4:
		run --separate-stderr tactus $c -m broken.toml
		status_is 3
		says broken.toml:1:
		run --separate-stderr tactus $c -m run.csv
		status_is 3
	done </dev/null
}

@test "foreign files: separator, decimal comma, other names and units" {
	printf 'millis;A0;Kraft [g]\n0;512;0,0\n100;600;101,97\n200;700;203,94\n' >log.csv
	run --separate-stderr tactus show log.csv --decimal-comma --columns 'time_s=millis/1000,adc_count=A0,force_N=Kraft [g]*0.00980665' --json
	status_is 0
	[ "$(jq -r '[.columns[].name] | join(" ")' <<<"$output")" = "time_s adc_count force_N" ]
	[ "$(jq '.columns[0].maximum' <<<"$output")" = 0.2 ]
	[ "$(jq '.columns[2].maximum * 1e6 | round' <<<"$output")" = 1999968 ]
	[ "$(jq -r '.metadata.columns' <<<"$output")" = 'time_s=millis/1000,adc_count=A0,force_N=Kraft [g]*0.00980665' ]
}

@test "every command reads foreign files: the values are those of the file in our own form" {
	recording >own.csv
	recording | sed 's/,/;/g; s/\./,/g; 1s/force_N/load_g/' >foreign.csv
	for c in "force -m $examples/model-forward.toml" "simulate -m $examples/model-forward.toml" "convert -g 1kohm" \
		"join own.csv --offset 0s" fit diagnose; do
		tactus $c own.csv >expected 2>/dev/null
		run --separate-stderr tactus $c foreign.csv --delimiter ';' --decimal-comma --columns 'force_N=load_g*1'
		status_is 0
		# What was mapped is in the metadata; file names differ.
		diff <(grep -v '^#' expected | sed 's/own\.csv/foreign.csv/') <(printf '%s\n' "$output" | grep -v '^#') || fail "$c"
	done
	run --separate-stderr tactus show foreign.csv --delimiter ';' --decimal-comma --columns 'force_N=load_g*1' --json
	status_is 0
	jq -e '.rows == 80 and .domain == "sensor"' <<<"$output"
}

@test "a mapping that is wrong says which column" {
	recording >run.csv
	run --separate-stderr tactus show run.csv --columns force_N=load
	[ "$status" -eq 2 ] || [ "$status" -eq 3 ] || fail "status $status"
	says load
	run --separate-stderr tactus show run.csv --columns force_N
	status_is 2
	run --separate-stderr tactus show run.csv --delimiter ab
	status_is 2
	says "--delimiter"
}
