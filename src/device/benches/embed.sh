#!/bin/sh
# Prints the C file that holds the TOML files which are given: the table tactus_builtins of src/device/bench.h.
set -eu
echo '#include "device/bench.h"'
echo '#pragma GCC diagnostic ignored "-Woverlength-strings"'
echo 'const tactus_builtin tactus_builtins[] = {'
for file in "$@"; do
	name=${file##*/}
	printf '{"%s",\n' "${name%.toml}"
	sed -e 's/\\/\\\\/g' -e 's/"/\\"/g' -e 's/^/"/' -e 's/$/\\n"/' "$file"
	echo '},'
done
echo '{0, 0}};'
