#!/bin/sh
# The first process of the rig's virtual machine: loads the drivers, starts the virtual devices, runs the suites named
# on the kernel's command line (suites=a,b) and leaves NAME.tap, NAME.err and NAME.status in /out for
# scripts/count-tests. The last line on the console is the sentinel that scripts/rig looks for.
export PATH=/rig:/usr/bin:/bin:/sbin LC_ALL=C CMOCKA_MESSAGE_OUTPUT=TAP HOME=/root

say() { echo "rig: $* ($(cut -d. -f1 /proc/uptime) s)"; }

mount -t proc proc /proc
mount -t sysfs sys /sys
mount -t devtmpfs dev /dev
mkdir -p /run /tmp /out
mount -t tmpfs tmp /run
mount -t tmpfs tmp /tmp
chmod 1777 /tmp
while read -r module; do insmod "/modules/$module" || say "$module does not load"; done </modules/order
mount -t 9p -o trans=virtio,version=9p2000.L,msize=262144 out /out || say "no /out"

# libusb hears of devices that come and go from udevd alone.
/usr/lib/systemd/systemd-udevd --daemon
udevadm trigger --action=add
udevadm settle --timeout=10

start() { # PROGRAM: in the background, until its socket is there
	"$1" >"/out/$1.err" 2>&1 &
	n=0
	while [ ! -S "/run/$1" ] && [ $n -lt 500 ]; do
		n=$((n + 1))
		usleep 10000
	done
}

run_suite() {
	timeout 240 "$1" >"/out/$1.tap" 2>"/out/$1.err" </dev/null
	echo $? >"/out/$1.status"
	say "$1 ended with status $(cat "/out/$1.status")"
}

say "booted"
start virtual_usb
start virtual_hid
suites=$(sed -n 's/.*suites=\([^ ]*\).*/\1/p' /proc/cmdline | tr , ' ')
for suite in $suites; do run_suite "$suite"; done
dmesg >/out/dmesg
sync
say "end of the run"
poweroff -f
