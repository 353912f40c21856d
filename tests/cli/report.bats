#!/usr/bin/env bats
# The page of `tactus diagnose --report`, in a browser: its pictures, its numbers, no request to anywhere.
load common

browser() {
	for b in chromium chromium-browser google-chrome; do
		type $b >/dev/null 2>&1 || continue
		# Root has no sandbox; what the browser says of the machine's missing buses and cards is of no interest.
		"$b" --headless --no-sandbox --disable-gpu --disable-dev-shm-usage --hide-scrollbars --no-first-run \
			--allow-file-access-from-files --user-data-dir="$BATS_TEST_TMPDIR/profile" "$@" 2>/dev/null
		return
	done
	return 127
}
needs_browser() {
	type chromium >/dev/null 2>&1 || type chromium-browser >/dev/null 2>&1 || type google-chrome >/dev/null 2>&1 ||
		skip "no Chromium"
	type gnuplot >/dev/null 2>&1 || skip "no gnuplot"
}

# A sensor that creeps, channel after channel; one recording for all tests of this file.
setup_file() {
	cd "$BATS_FILE_TMPDIR" || return
	cat >bench.toml <<-'EOB'
		kind = "bench"
		base = "paredes"
		name = "bench"
		seed = 3
		protocol = "rest 5s, hold 150N 30s, rest 20s, hold 90N 30s, rest 20s, staircase 0N..180N 30N 2s"
		[scan]
		rate_Hz = 5
		[[effect]]
		name = "creep"
		amplitude_1 = 0.03
		amplitude_10 = 0.06
	EOB
	tactus scan sim:bench.toml --channels 1,2 -q -o two.csv
	tactus scan sim:bench.toml --channels 1 -q -o one.csv
	for n in one two; do
		tactus diagnose $n.csv --report $n --json >$n.json
	done
}

# measure DIR WIDTH: what the browser makes of the page in a frame of that width, as JSON: size of the document, boxes
# of the pictures, texts that leave their picture, what was requested, numbers with their place in the JSON.
measure() {
	cat >frame.html <<-EOF
		<script>
		const measure = event => {
			const w = event.target.contentWindow, d = w.document;
			d.querySelectorAll("details").forEach(e => e.open = true);
			const box = e => { const b = e.getBoundingClientRect(); return [b.left, b.top, b.right, b.bottom]; };
			const pictures = [...d.querySelectorAll("svg")].map(s => {
				const outside = [...s.querySelectorAll("text")].filter(t => {
					const a = t.getBoundingClientRect(), b = s.getBoundingClientRect();
					return a.left < b.left - 1 || a.right > b.right + 1 || a.top < b.top - 1 || a.bottom > b.bottom + 1;
				}).map(t => t.textContent);
				const text = s.querySelector("text");
				const texts = [...s.querySelectorAll("text")].map(t => t.textContent.trim().replace(/\s+/g, " "));
				return {label: s.getAttribute("aria-label"), texts, box: box(s), drawn: s.getBBox().width, outside,
					marks: [...s.querySelectorAll("path")].reduce((n, p) => n + p.getAttribute("d").length, 0),
					bars: s.querySelectorAll("polygon").length,
					letters: text ? text.getBoundingClientRect().height : 0};
			});
			const numbers = [...d.querySelectorAll("[data-json]")].map(e => [e.dataset.json, e.dataset.value, e.textContent]);
			document.body.textContent = "RESULT" + JSON.stringify({
				width: d.documentElement.clientWidth, scroll: d.documentElement.scrollWidth, pictures, numbers,
				requests: w.performance.getEntriesByType("resource").map(e => e.name),
				verdict: d.getElementById("verdict").dataset.verdict, command: d.getElementById("command").textContent,
				channels: d.querySelectorAll("section").length}) + "END";
		};
		</script>
		<body style="margin:0"><iframe onload="measure(event)" src="file://$BATS_FILE_TMPDIR/$1/index.html" style="width:$2px;height:900px;border:0"></iframe>
	EOF
	browser --window-size=1400,1000 --virtual-time-budget=10000 --dump-dom "file://$PWD/frame.html" |
		tr '\n' ' ' | sed -n 's/.*RESULT\(.*\)END<.*/\1/p' | sed 's/&lt;/</g; s/&gt;/>/g; s/&amp;/\&/g' >measured.json
	jq -e . measured.json >/dev/null
}

@test "every picture is there and drawn, on a phone and on a desk; nothing is cut off or too small to read" {
	needs_browser
	for page in one two; do
		for width in 390 1280; do
			measure $page $width
			"$PYTHON" - $page $width <<-'EOP'
				import json, sys
				m = json.load(open("measured.json"))
				page, width = sys.argv[1], int(sys.argv[2])
				series = 2 if page == "two" else 1
				assert m["width"] == width and m["scroll"] <= width, (m["width"], m["scroll"])
				assert m["channels"] == series
				assert len(m["pictures"]) >= 6 * series, [p["label"] for p in m["pictures"]]
				for p in m["pictures"]:
				    left, top, right, bottom = p["box"]
				    assert right - left > 0.8 * min(width, 400) and bottom - top > 150, p
				    assert left >= 0 and right <= width, p
				    assert p["drawn"] > 200 and p["marks"] + 100 * p["bars"] > 800, p
				    assert not p["outside"], p
				    assert p["letters"] >= 9, p
				evidence = [p for p in m["pictures"] if p["label"].startswith("Evidence")]
				assert len(evidence) == series and all(p["bars"] > 5 for p in evidence)
			EOP
		done
	done
}

@test "its numbers are those of the JSON, to the last digit, and none is missing" {
	needs_browser
	for page in one two; do
		measure $page 800
		"$PYTHON" - $page "$BATS_FILE_TMPDIR" <<-'EOP'
			import json, re, sys
			m = json.load(open("measured.json"))
			text = open(f"{sys.argv[2]}/{sys.argv[1]}.json").read()
			result = json.loads(text, parse_float=str, parse_int=str)
			def at(path):
			    value = result
			    for key, index in re.findall(r"\.(\w+)|\[(\d+)\]", path):
			        value = value[key] if key else value[int(index)]
			    return value
			shown = {}
			for path, value, what in m["numbers"]:
			    assert (at(path) or "") == value, (path, at(path), value)
			    shown[path] = what
			def numbers(value, path):
			    if isinstance(value, dict):
			        for k, v in value.items():
			            if k not in ("channel", "samples", "every", "problems", "unit"):
			                yield from numbers(v, f"{path}.{k}")
			    elif isinstance(value, list):
			        for i, v in enumerate(value):
			            yield from numbers(v, f"{path}[{i}]")
			    elif isinstance(value, str) and re.fullmatch(r"-?[0-9.]+(e[-+]?[0-9]+)?", value):
			        yield path
			missing = [p for p in numbers(result, "") if p not in shown]
			assert not missing, missing
			assert m["verdict"] == result["verdict"]
		EOP
	done
}

@test "a cause names its source as such" {
	type gnuplot >/dev/null 2>&1 || skip "no gnuplot"
	source=$(jq -r '.series[0].causes[0].source' "$BATS_FILE_TMPDIR/one.json")
	grep -qF "Source: $source" "$BATS_FILE_TMPDIR/one/index.html"
}

@test "every candidate of the evidence has its label and value in the picture, as the JSON has them" {
	needs_browser
	measure one 1280
	"$PYTHON" - "$BATS_FILE_TMPDIR/one.json" <<-'EOP'
		import json, sys
		series = json.load(open(sys.argv[1]))["series"][0]
		texts, = [p["texts"] for p in json.load(open("measured.json"))["pictures"] if p["label"].startswith("Evidence")]
		assert len(series["candidates"]) > 10
		for candidate in series["candidates"]:
		    assert texts.count(candidate["effect"]) == 1, (candidate, texts)
		    shown = texts[texts.index(candidate["effect"]) + 1]
		    if candidate["why"]:
		        assert shown == "not testable", (candidate, shown)
		    elif candidate["delta_bic"] is None:
		        assert shown == "not tried", (candidate, shown)
		    else:
		        evidence = -candidate["delta_bic"]
		        assert abs(float(shown.replace("−", "-")) - evidence) <= (0.0501 if abs(evidence) < 10 else 0.501), (candidate, shown)
		for cause in series["causes"]:
		    assert cause["effect"] in texts, cause["effect"]
	EOP
}

@test "no network, no script: nothing is requested, and nothing could be" {
	needs_browser
	measure one 800
	[ "$(jq -c .requests measured.json)" = "[]" ]
	page=$BATS_FILE_TMPDIR/one/index.html
	if grep -Eio '<script|https?:|<img|@import|url\([^#]|src=' "$page"; then fail "it refers to something outside"; fi
	grep -q "default-src 'none'" "$page"
	[ "$(stat -c %s "$page")" -lt 1000000 ]
	[ "$(ls -A "$BATS_FILE_TMPDIR/one")" = index.html ]
}

@test "the screenshot of a phone and of paper is not blank" {
	needs_browser
	page=file://$BATS_FILE_TMPDIR/one/index.html
	browser --window-size=500,3000 --screenshot=shot.png "$page"
	cat >count.html <<-EOF
		<script>
		const count = event => {
			const i = event.target, c = document.createElement("canvas");
			c.width = i.naturalWidth;
			c.height = i.naturalHeight;
			const context = c.getContext("2d");
			context.drawImage(i, 0, 0);
			const d = context.getImageData(0, 0, c.width, c.height).data;
			const near = (r, g, b) => {
				let n = 0;
				for (let k = 0; k < d.length; k += 4)
					n += Math.abs(d[k] - r) + Math.abs(d[k + 1] - g) + Math.abs(d[k + 2] - b) < 60;
				return n;
			};
			document.body.textContent = "PIXELS " + [near(0xc2, 0x50, 0x0a), near(0, 0x68, 0xa8), near(0x1a, 0x1d, 0x21)].join(" ") + " .";
		};
		</script>
		<body><img onload="count(event)" src="file://$PWD/shot.png">
	EOF
	read -r before after ink < <(browser --virtual-time-budget=10000 --dump-dom "file://$PWD/count.html" |
		sed -n 's/.*PIXELS \([0-9 ]*\) \..*/\1/p')
	[ "$before" -gt 300 ] && [ "$after" -gt 300 ] && [ "$ink" -gt 3000 ] || fail "$before $after $ink"
	browser --no-pdf-header-footer --print-to-pdf=page.pdf "$page"
	[ "$(head -c 5 page.pdf)" = "%PDF-" ]
	[ "$(stat -c %s page.pdf)" -gt 30000 ]
}

@test "long names of columns: nothing leaves the page, a table or a picture; on paper no table is cut, powers of ten are whole" {
	needs_browser
	long=covariate_with_a_very_long_name_that_somebody_gave_it_in_a_spreadsheet_and_never_shortened
	awk -F, -v OFS=, -v long=$long '
		/^#/ { print; next }
		!g { for (i = 1; i <= NF; i++) if ($i == "conductance_S") g = i; else if ($i == "mode") m = i; print $0, long; next }
		$m == "dc" { w = sin(k++ * 0.055); $g += 2e-5 * w; print $0, w }' "$BATS_FILE_TMPDIR/one.csv" >long.csv
	tactus diagnose long.csv --output conductance_S --report "$BATS_FILE_TMPDIR/long" --overwrite >/dev/null
	grep -q "$long" "$BATS_FILE_TMPDIR/long/index.html"
	measure long 390
	jq -e '.scroll <= .width and all(.pictures[]; .outside == [])' measured.json
	# In a minus that alone is raised, what follows stands on the line.
	run grep -c '>-</tspan>' "$BATS_FILE_TMPDIR/long/index.html"
	[ "$output" = 0 ]
	grep -q '@media print.*table{break-inside:avoid}.scroll{overflow:visible}' "$BATS_FILE_TMPDIR/long/index.html"
}

@test "the command on the page repeats it, byte for byte" {
	type gnuplot >/dev/null || skip "no gnuplot"
	cp "$BATS_FILE_TMPDIR/one.csv" "it's one.csv"
	tactus diagnose "it's one.csv" --report dir --seed 5 --output conductance_S >/dev/null
	cp dir/index.html first.html
	command=$(sed -n 's/.*<pre id="command">\(.*\)<\/pre>.*/\1/p' dir/index.html | sed "s/&#39;/'/g; s/&quot;/\"/g; s/&amp;/\&/g")
	[ "$command" = "tactus diagnose 'it'\\''s one.csv' --report dir --seed 5 --output conductance_S --overwrite" ]
	eval "$command" >/dev/null
	cmp first.html dir/index.html
}

@test "text of the recording cannot become markup" {
	type gnuplot >/dev/null || skip "no gnuplot"
	sed 's/temperature_degC/<script>alert(1)<\/script>_`x`/' "$BATS_FILE_TMPDIR/one.csv" >'<b>&".csv'
	tactus diagnose '<b>&".csv' --report dir >/dev/null
	if grep -q '<script\|<b>&' dir/index.html; then fail "markup of the recording is in the page"; fi
}

@test "without gnuplot: status 1 and the name of the package; the page in the terminal is printed all the same" {
	mkdir bin
	ln -s "$(command -v tactus)" "$(dirname "$(command -v tactus)")/libtactus.so.0" bin/
	run --separate-stderr env PATH="$PWD/bin" tactus diagnose "$BATS_FILE_TMPDIR/one.csv" --report dir
	status_is 1
	says "gnuplot-nox"
	prints "simulation"
	[ ! -e dir/index.html ]
}

@test "a report that exists is refused with status 2 before any work; --overwrite replaces it" {
	type gnuplot >/dev/null || skip "no gnuplot"
	mkdir dir
	echo precious >dir/index.html
	run --separate-stderr tactus diagnose nosuch.csv --report dir
	status_is 2
	says dir/index.html
	tactus diagnose "$BATS_FILE_TMPDIR/one.csv" --report dir --overwrite >/dev/null
	grep -q "</html>" dir/index.html
	[ "$(ls -A dir)" = index.html ]
	run --separate-stderr tactus diagnose "$BATS_FILE_TMPDIR/one.csv" --report nosuch/dir
	status_is 6
	says nosuch/dir
}
