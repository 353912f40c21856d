#!/bin/sh
# The README's pictures of a diagnosis, the page in the terminal and the report, by the README's own commands:
# scripts/figures/diagnose.sh, where tactus, script and chromium are.
set -eu
cd "$(dirname "$0")/../.."
figures=$PWD/scripts/figures
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
tactus=$PWD/${BUILD:-build}/tactus
picture() { # HTML PNG WIDTH,HEIGHT
	chromium --headless --no-sandbox --hide-scrollbars --window-size="$3" --screenshot="$figures/$2" "file://$1"
}

"$tactus" scan sim:tests/examples/bench-creep.toml --channels 2 -q -o "$work/tuesday.csv"
cd "$work"
# What a terminal shows, its three codes (headline, bold, plain) as HTML.
escape=$(printf '\033')
{
	echo '<meta charset="utf-8"><style>body{margin:0;background:#14181c;color:#d8dee4}b{color:#fff}i{font-style:normal;'
	echo 'font-weight:bold;color:#6fd08c}u{color:#8b949e;text-decoration:none}pre{margin:16px 20px;font:14px/1.45 monospace}'
	command='tactus diagnose tuesday.csv --extended tuesday.toml --report tuesday'
	echo "</style><pre><u>\$ $command</u>"
	PATH=${tactus%/*}:$PATH TERM=xterm script -qec "$command" /dev/null |
		tr -d '\r' | sed -e 's/&/\&amp;/g; s/</\&lt;/g' -e "s/$escape\[1;32m\(.*\)/<i>\1<\/i>/; s/$escape\[1m/<b>/; s/$escape\[m/<\/b>/g"
	echo '</pre>'
} >page.html
picture "$work/page.html" terminal.png 740,418
picture "$work/tuesday/index.html" diagnose.png 900,1290
