#!/usr/bin/env bats
# Every file under tests/examples is what its name says, and can be used as such.

load common

@test "every example is shown as what it is" {
	for file in "$examples"/*; do
		case $(basename "$file") in
		model-*) kind='model, domain' ;;
		bench-*) kind='bench' ;;
		recording*) kind='recording, ' ;;
		*) continue ;; # foreign logs and loads have tests of their own
		esac
		run tactus show "$file"
		[ "$status" -eq 0 ]
		[[ ${lines[0]} == *": "*"$kind"* ]] || { echo "$file: ${lines[0]}" && false; }
	done
}

@test "every example of a bench scans, and the same seed gives the same bytes" {
	for file in "$examples"/bench-*.toml; do
		tactus scan "sim:$file" --count 3 >one.csv
		tactus scan "sim:$file" --count 3 >two.csv
		cmp one.csv two.csv
		[ "$(grep -vc '^#' one.csv)" -gt 1 ]
	done
}

@test "the example recordings convert to themselves, and JSON Lines is the CSV in other words" {
	for file in recording recording-readout; do
		tactus convert "$examples/$file.csv" | cmp - "$examples/$file.csv"
	done
	tactus convert "$examples/recording.csv" --format jsonl | cmp - "$examples/recording.jsonl"
	tactus convert "$examples/recording.jsonl" | cmp - "$examples/recording.csv"
}

@test "the detectors' volts of the raw example give its resistances" {
	tactus convert "$examples/recording-raw.csv" -o converted.csv
	tactus show --json converted.csv >facts.json
	[ "$(jq '.rows' facts.json)" -eq 8 ]
	[ "$(jq '[.columns[] | select(.name == "resistance_ohm") | .values] == [8]' facts.json)" = true ]
}

@test "every model of the example sensors gives the example recording a force" {
	for model in linear network weighted; do
		tactus force -m "$examples/model-$model.toml" "$examples/recording.csv" | grep -v '^#' >force.csv
		head -1 force.csv | grep -q force_estimate_N
	done
}
