#!/bin/sh
# The README's picture of a report, by the README's own commands: scripts/figures/diagnose.sh, where tactus and chromium are.
set -eu
cd "$(dirname "$0")/../.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
tactus=$PWD/${BUILD:-build}/tactus
"$tactus" scan sim:tests/examples/bench-creep.toml --channels 2 -q -o "$work/tuesday.csv"
(cd "$work" && "$tactus" diagnose tuesday.csv --report tuesday >/dev/null)
chromium --headless --no-sandbox --hide-scrollbars --window-size=900,1290 \
	--screenshot="$PWD/scripts/figures/diagnose.png" "file://$work/tuesday/index.html"
