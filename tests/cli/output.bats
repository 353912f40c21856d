#!/usr/bin/env bats
# Output: files that are written whole or not at all, full disks, readers that leave, signals, standard input.
load common

model=$examples/model-forward.toml
writers() { # every command that writes a recording or a file, given run.csv
	printf '%s\n' "scan sim: --count 5" "convert scan.csv" "fit run.csv" "force -m $model run.csv" \
		"simulate -m $model run.csv" "join run.csv run.csv" "diagnose run.csv"
}
prepare() {
	recording >run.csv
	tactus scan sim: --count 20 >scan.csv
}

@test "-o writes what standard output would have" {
	prepare
	while read -r c; do
		[[ $c == fit* ]] && continue
		tactus $c 2>/dev/null >expected
		tactus $c -o written.csv 2>/dev/null
		cmp expected written.csv
		rm written.csv
	done < <(writers)
}

@test "-o refuses an existing file with status 2 and leaves it alone; --overwrite replaces it" {
	prepare
	while read -r c; do
		echo precious >out
		run --separate-stderr tactus $c -o out
		status_is 2
		says out
		[ "$(cat out)" = precious ]
		run --separate-stderr tactus $c -o out --overwrite
		status_is 0
		[ "$(wc -l <out)" -gt 1 ]
	done < <(writers)
}

@test "-o writes through a link, to the file that is there and to one that is not yet" {
	prepare
	mkdir -p elsewhere
	while read -r c; do
		rm -f elsewhere/*
		ln -sfn second link
		ln -sfn elsewhere/out second
		tactus $c -o link 2>/dev/null || fail "$c: not written"
		tactus $c -o link --overwrite 2>/dev/null || fail "$c: not replaced"
		[[ -L link && -L second && -s elsewhere/out && $(ls elsewhere) == out ]] || fail "$c: $(ls -l . elsewhere)"
	done < <(writers)
}

@test "fit: a file that exists is refused before the work, not after it" {
	echo precious >out
	run --separate-stderr tactus fit nosuch.csv -o out
	status_is 2
	says "out"
	[ -z "$output" ]
	run --separate-stderr tactus fit nosuch.csv -o out --overwrite
	status_is 3
	[ "$(cat out)" = precious ]
}

@test "a full disk is status 6, on standard output and with -o" {
	prepare
	[ -e /dev/full ] || skip "no /dev/full"
	while read -r c; do
		run --separate-stderr bash -c "tactus $c >/dev/full"
		status_is 6
		says "tactus"
	done < <(writers)
	run --separate-stderr bash -c "tactus show run.csv >/dev/full"
	status_is 6
	run --separate-stderr bash -c "tactus show --json run.csv >/dev/full"
	status_is 6
	run --separate-stderr bash -c "tactus --help >/dev/full"
	status_is 6
	run --separate-stderr bash -c "tactus devices >/dev/full"
	status_is 6
}

@test "a folder that cannot be written: status 6 (or refused), nothing left" {
	prepare
	while read -r c; do
		run --separate-stderr tactus $c -o nosuch/out.csv
		status_is 6
		says nosuch/out.csv
	done < <(writers)
}

@test "standard output that is closed is status 6, not silence" {
	prepare
	while read -r c; do
		run --separate-stderr bash -c "tactus $c >&-"
		status_is 6
	done < <(writers)
}

@test "a reader that has enough: every stage ends with 0 and says nothing" {
	tactus scan sim: --count 30 | tactus fit - -q -o m.toml >/dev/null
	run --separate-stderr bash -c "tactus scan sim: --count 3000 | tactus convert | tactus force -m m.toml | head -5; echo \${PIPESTATUS[*]}"
	[ "${lines[5]}" = "0 0 0 0" ] || fail "statuses ${lines[5]}"
	[ -z "$stderr" ] || fail "not quiet"
	run --separate-stderr bash -c "tactus show --effects | head -1; echo \${PIPESTATUS[*]}"
	[ "${lines[1]}" = "0 0" ]
	[ -z "$stderr" ]
}

@test "the same bytes from a file, from '-' and from a pipe without a name" {
	prepare
	for c in "convert" "force -m $model" "simulate -m $model" "fit" "convert --json"; do
		f=run.csv
		[[ $c == convert* ]] && f=scan.csv
		tactus $c $f >from_file
		tactus $c - <$f >from_dash
		tactus $c <$f >from_redirect
		cat $f | tactus $c >from_pipe
		cmp from_file from_dash
		cmp from_file from_redirect
		cmp from_file from_pipe
	done
	[ "$(tactus show run.csv | tail -n +2)" = "$(tactus show - <run.csv | tail -n +2)" ]
	[ "$(tactus join run.csv run.csv --offset 0)" = "$(tactus join run.csv --offset 0 <run.csv)" ]
	[ "$(tactus join run.csv run.csv --offset 0)" = "$(tactus join run.csv - --offset 0 <run.csv)" ]
}

@test "no recording and a terminal: usage, not a wait" {
	type script >/dev/null || skip "script(1) is not installed"
	for c in convert fit "force -m $model" "simulate -m $model" show; do
		run script -qec "tactus $c" /dev/null
		status_is 2
		prints "no recording"
	done
}

@test "records pass at once: a line in, a line out, while the input stays open" {
	recording 2 >two.csv
	"$PYTHON" - "$model" <<-'EOP'
		import subprocess, sys
		p = subprocess.Popen(["tactus", "force", "-m", sys.argv[1]], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
		lines = open("two.csv").read().splitlines(True)
		p.stdin.write(lines[0])
		for line in lines[1:]:
		    p.stdin.write(line); p.stdin.flush()
		    got = p.stdout.readline()
		    while got.startswith(("#", "time_s")): got = p.stdout.readline()
		    assert got.startswith(line.strip()), (line, got)
		p.stdin.close()
		assert p.wait() == 0
	EOP
}

# python has no inherited ignored SIGINT to pass on, unlike a shell's background job.
interrupt() { # SIGNAL COMMAND…: starts it, waits for a record, sends the signal; prints status and record count
	"$PYTHON" - "$@" <<-'EOP'
		import signal, subprocess, sys
		number = getattr(signal, sys.argv[1])
		p = subprocess.Popen(sys.argv[2:], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
		lines = 0
		while lines < 1:
		    line = p.stdout.readline()
		    if not line: sys.exit(f"ended before a record, status {p.wait()}: {p.stderr.read()}")
		    lines += not line.startswith(("#", "time_s"))
		p.send_signal(number)
		rest = p.stdout.read()
		lines += rest.count("\n")
		print(p.wait(), lines, "whole" if rest == "" or rest.endswith("\n") else "cut", p.stderr.read().strip())
	EOP
}

@test "the first SIGINT or SIGTERM stops a live scan cleanly: 130 or 143, whole lines, what came is kept" {
	run interrupt SIGINT tactus scan sim: --realtime --channels 1 --rate 20Hz
	[[ ${lines[0]} == "130 "*" whole"* ]] || fail "${lines[0]}"
	run interrupt SIGTERM tactus scan sim: --realtime --channels 1 --rate 20Hz
	[[ ${lines[0]} == "143 "*" whole"* ]] || fail "${lines[0]}"
}

@test "the second SIGINT aborts a scan that cannot end, because nobody reads what it writes" {
	"$PYTHON" - <<-'EOP'
		import signal, subprocess, time
		p = subprocess.Popen(["tactus", "scan", "sim:", "--count", "1000000"], stdout=subprocess.PIPE)
		p.stdout.read(1) # it runs; soon the pipe is full
		def of(key): return next(l.split()[1] for l in open(f"/proc/{p.pid}/status") if l.startswith(key))
		while of("State") != "S": time.sleep(0.01)
		p.send_signal(signal.SIGINT)
		deadline = time.monotonic() + 20
		while int(of("SigCgt"), 16) & 2 and time.monotonic() < deadline: time.sleep(0.01) # until the first was taken
		assert p.poll() is None
		p.send_signal(signal.SIGINT)
		assert p.wait(20) == -signal.SIGINT, p.returncode
	EOP
}

@test "an interrupted scan keeps its file" {
	"$PYTHON" - <<-'EOP'
		import signal, subprocess
		p = subprocess.Popen(["tactus", "scan", "sim:", "--realtime", "--channels", "1", "--rate", "20Hz", "-o", "kept.csv"])
		while p.poll() is None: # until a record stands in the file
		    try:
		        if sum(not l.startswith(("#", "time_s")) for l in open("kept.csv")) > 0: break
		    except FileNotFoundError:
		        pass
		p.send_signal(signal.SIGINT)
		assert p.wait() == 130, p.returncode
	EOP
	[ "$(grep -vc '^#' kept.csv)" -gt 1 ]
	tactus show kept.csv
}

@test "a filter that is interrupted while it waits ends with 130 and keeps what a stream brought" {
	recording 3 >three.csv
	"$PYTHON" - "$model" <<-'EOP'
		import signal, subprocess, sys
		p = subprocess.Popen(["tactus", "force", "-m", sys.argv[1]], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
		p.stdin.write(open("three.csv").read()); p.stdin.flush()
		seen = []
		while len(seen) < 6:
		    line = p.stdout.readline()
		    if not line.startswith(("#", "time_s")): seen.append(line)
		p.send_signal(signal.SIGINT)
		p.stdout.read()
		assert p.wait() == 130, p.returncode
	EOP
}

@test "--quiet says nothing on success, --verbose and the default keep standard output the same" {
	prepare
	run --separate-stderr tactus join run.csv run.csv --quiet
	status_is 0
	[ -z "$stderr" ]
	quiet=$output
	run --separate-stderr tactus join run.csv run.csv
	[ -n "$stderr" ]
	[ "$output" = "$quiet" ]
	run --separate-stderr tactus join run.csv run.csv --verbose
	[ "$output" = "$quiet" ]
}

@test "JSON Lines: metadata first, then a record per row with the same values as the CSV" {
	prepare
	for c in "convert scan.csv" "force -m $model run.csv" "simulate -m $model run.csv" "scan sim: --count 5"; do
		tactus $c >csv
		tactus $c --format jsonl >jsonl
		tactus $c --json | cmp - jsonl
		[ "$(head -1 jsonl | jq -r 'keys[0]')" = metadata ]
		jq -es '.[1:] | all(type == "object")' jsonl >/dev/null
		[ "$(tail -n +2 jsonl | wc -l)" -eq "$(grep -vc -e '^#' -e '^time_s' csv)" ]
		"$PYTHON" - <<-'EOP'
			import csv, json
			rows = list(csv.DictReader(l for l in open("csv") if not l.startswith("#")))
			records = [json.loads(l) for l in open("jsonl")][1:]
			for row, record in zip(rows, records, strict=True):
			    assert list(row) == list(record), (row, record)
			    for k, v in row.items():
			        assert (record[k] is None if v == "" else record[k] == v or float(record[k]) == float(v)), (k, v, record[k])
		EOP
	done
}
