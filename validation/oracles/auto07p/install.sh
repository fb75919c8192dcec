#!/bin/sh
# AUTO-07p and a Fortran compiler from the distribution, where that can be done; never fails.
[ -f "${AUTO_DIR:-/usr/lib/auto-07p}/lib/main.o" ] && command -v gfortran >/dev/null && exit 0
if command -v apt-get >/dev/null; then
    if [ "$(id -u)" = 0 ]; then
        apt-get install -y -qq auto-07p gfortran >/dev/null 2>&1
    elif command -v sudo >/dev/null && sudo -n true 2>/dev/null; then
        sudo -n apt-get install -y -qq auto-07p gfortran >/dev/null 2>&1
    fi
fi
[ -f "${AUTO_DIR:-/usr/lib/auto-07p}/lib/main.o" ] && command -v gfortran >/dev/null ||
    echo "AUTO-07p: skipped: not installed (Debian packages auto-07p and gfortran)"
exit 0
