#!/usr/bin/env bats
# The installed copy, used as a stranger would: pkg-config alone, no file of the source tree.

setup_file() {
	export PREFIX_DIR="$BATS_FILE_TMPDIR/prefix"
	make -s BUILD="$BUILD" PREFIX="$PREFIX_DIR" install
	export PKG_CONFIG_PATH="$PREFIX_DIR/lib/pkgconfig"
	unset LD_LIBRARY_PATH
}

# Amplitude and phase of R ∥ C at 1 V, 4 kHz and Rg = 1 kohm, by complex arithmetic of our own.
reading() { # NEWTONS
	"$PYTHON" -c "
import cmath, math
g, c = 2e-6 + 5e-6 * $1, 1e-10
h = 1000 * complex(g, 2 * math.pi * 4000 * c)
print(abs(h), cmath.phase(h))"
}

newtons_at_12_and_250() {
	local output
	output=$({ reading 12; reading 250; } | "$1" tests/install/model.toml)
	echo "$output"
	[[ $(sed -n 1p <<<"$output") =~ ^12\.000\ N,\ standard\ uncertainty\ 0\.[0-9]+\ N,\ ok$ ]]
	[[ $(sed -n 2p <<<"$output") =~ ^250\.000\ N,.*extrapolated ]]
	[ "$(wc -l <<<"$output")" -eq 2 ]
}

@test "a C program builds with pkg-config alone, finds the library and turns readings into newtons" {
	# shellcheck disable=SC2046  # flags are meant to split
	cc -std=c11 -Wall -Wextra -Werror tests/install/newtons.c -o "$BATS_TEST_TMPDIR/newtons" \
		$(pkg-config --cflags --libs tactus) -Wl,-rpath,"$(pkg-config --variable=libdir tactus)"
	newtons_at_12_and_250 "$BATS_TEST_TMPDIR/newtons"
	ldd "$BATS_TEST_TMPDIR/newtons" | grep -q "libtactus.so.0 => $PREFIX_DIR/lib/libtactus.so.0"
}

@test "the same program links the static library with pkg-config --static" {
	cp -r "$PREFIX_DIR" "$BATS_TEST_TMPDIR/static"
	rm "$BATS_TEST_TMPDIR"/static/lib/libtactus.so*
	# shellcheck disable=SC2046
	cc -std=c17 tests/install/newtons.c -o "$BATS_TEST_TMPDIR/newtons" \
		$(pkg-config --define-variable=prefix="$BATS_TEST_TMPDIR/static" --define-variable=libdir="$BATS_TEST_TMPDIR/static/lib" \
			--static --cflags --libs tactus)
	run ldd "$BATS_TEST_TMPDIR/newtons"
	[[ $output != *libtactus* ]]
	newtons_at_12_and_250 "$BATS_TEST_TMPDIR/newtons"
}

@test "a C++ program builds with pkg-config alone and runs" {
	# shellcheck disable=SC2046
	c++ -std=c++17 -Wall -Wextra -Werror tests/install/blocks.cpp -o "$BATS_TEST_TMPDIR/blocks" \
		$(pkg-config --cflags --libs tactus) -Wl,-rpath,"$(pkg-config --variable=libdir tactus)"
	run "$BATS_TEST_TMPDIR/blocks"
	[ "$status" -eq 0 ]
	[[ ${lines[0]} == "# tactus: "* ]] || [[ ${lines[0]} == force_N ]]
	[[ $output == *"force_N"*$'\n'"0.1"$'\n'"2.5"* ]]
	[[ ${lines[-1]} == "version $(pkg-config --modversion tactus), worst relative error below 1e-12: yes, missing file: TACTUS_ERR_INPUT" ]]
}

@test "pkg-config names our library alone for the shared one, and all that it is made of with --static" {
	[ "$(pkg-config --libs-only-l tactus | xargs)" = "-ltactus" ]
	[[ $(pkg-config --static --libs tactus) == *-lceres*-lstdc++* ]]
	[ "$(pkg-config --variable=prefix tactus)" = "$PREFIX_DIR" ]
}

@test "the installed program finds the installed library, wherever the prefix is moved to" {
	[ "$(env -i "$PREFIX_DIR/bin/tactus" --version)" = "tactus $(pkg-config --modversion tactus)" ]
	cp -r "$PREFIX_DIR" "$BATS_TEST_TMPDIR/moved"
	ldd "$BATS_TEST_TMPDIR/moved/bin/tactus" | grep -q "moved/bin/../lib/libtactus.so.0"
}

@test "man pages and completion are installed, and every command has a page" {
	for command in $("$TACTUS" --help | sed -n '/^Commands:/,/^$/s/^  \([a-z][a-z]*\) .*/\1/p'); do
		[ -s "$PREFIX_DIR/share/man/man1/tactus-$command.1" ]
	done
	[ -s "$PREFIX_DIR/share/man/man1/tactus.1" ]
	[ "$(find "$PREFIX_DIR/share/man/man1" -name 'tactus-*.1' | wc -l)" -ge 8 ]
	bash -n "$PREFIX_DIR/share/bash-completion/completions/tactus"
}

@test "DESTDIR and split directories are honoured, and the program still finds its library" {
	local d="$BATS_TEST_TMPDIR/image"
	make -s BUILD="$BUILD" DESTDIR="$d" PREFIX=/opt/tactus LIBDIR=/opt/tactus/lib/x86_64-linux-gnu install
	[ -e "$d/opt/tactus/lib/x86_64-linux-gnu/pkgconfig/tactus.pc" ]
	grep -qx 'libdir=/opt/tactus/lib/x86_64-linux-gnu' "$d/opt/tactus/lib/x86_64-linux-gnu/pkgconfig/tactus.pc"
	"$d/opt/tactus/bin/tactus" --version
	ldd "$d/opt/tactus/bin/tactus" | grep -q "image/opt/tactus/.*libtactus"
}

@test "uninstall removes what install put there and nothing else" {
	local d="$BATS_TEST_TMPDIR/image"
	mkdir -p "$d/usr/include/tactus" "$d/usr/bin"
	echo mine >"$d/usr/include/tactus/mine.h"
	echo mine >"$d/usr/bin/tactus-mine"
	make -s BUILD="$BUILD" DESTDIR="$d" PREFIX=/usr install
	[ "$(find "$d" -not -type d | wc -l)" -gt 15 ]
	make -s BUILD="$BUILD" DESTDIR="$d" PREFIX=/usr uninstall
	[ "$(cd "$d" && find . -not -type d | sort | xargs)" = "./usr/bin/tactus-mine ./usr/include/tactus/mine.h" ]
}

@test "the shared library exports what the headers declare, no more and no less" {
	"$PYTHON" - include/tactus/*.h >"$BATS_TEST_TMPDIR/declared" <<'PY'
import re, sys
text = "".join(re.sub(r"/\*.*?\*/", "", open(f).read(), flags=re.S) for f in sys.argv[1:])
print("\n".join(sorted(set(re.findall(r"TACTUS_API[^;(]*?\b(tactus_\w+)\s*[(;]", text)))))
PY
	nm -D --defined-only "$BUILD/libtactus.so" | awk '$2 != "A" { sub(/@.*/, "", $3); print $3 }' | sort >"$BATS_TEST_TMPDIR/exported"
	diff "$BATS_TEST_TMPDIR/declared" "$BATS_TEST_TMPDIR/exported"
	[ "$(wc -l <"$BATS_TEST_TMPDIR/exported")" -gt 50 ]
	readelf -d "$BUILD/libtactus.so" | grep -q 'soname: \[libtactus.so.0\]'
}

@test "make headers: every public header compiles alone as C11, C17 and C++17" {
	make -s BUILD="$BUILD" headers
}
