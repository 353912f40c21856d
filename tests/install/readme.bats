#!/usr/bin/env bats
# README.md says what works: its commands run as they stand, its C program is the one that is tested.

@test "the commands of README.md run as they stand, in their order" {
	ln -s "$PWD/tests" "$BATS_TEST_TMPDIR/tests"
	awk '/^```sh$/{ on = 1; next } /^```$/{ on = 0 } on' README.md >"$BATS_TEST_TMPDIR/tour.sh"
	[ "$(grep -c '^tactus' "$BATS_TEST_TMPDIR/tour.sh")" -ge 10 ]
	(cd "$BATS_TEST_TMPDIR" && bash -euo pipefail tour.sh >tour.out) || { tail -5 "$BATS_TEST_TMPDIR/tour.out"; return 1; }
	for file in scan.csv calibration.csv bench.toml run.csv predicted.csv hand.csv; do
		[ -s "$BATS_TEST_TMPDIR/$file" ]
	done
	grep -q force_estimate_std_N "$BATS_TEST_TMPDIR/run.csv"
}

@test "the program in README.md is the one that is built against the installed copy" {
	awk '/^```c$/{ on = 1; next } /^```$/{ on = 0 } on' README.md | diff - tests/install/newtons.c
}
