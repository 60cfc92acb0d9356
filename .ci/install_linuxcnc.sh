#!/bin/sh
# LinuxCNC's interpreter and whole simulator for the tests marked `linuxcnc` and `controller`,
# without the some 330 graphical packages its Debian package depends on: about 70 MB, under a minute.
# Where it cannot be had this says why and exits 0: those tests are then skipped.
set -u

without() {
    echo "LinuxCNC not installed: $1; the tests marked linuxcnc and controller will be skipped"
    exit 0
}

package=linuxcnc-uspace
libraries="python3 libpython3.11 libboost-python1.74.0 libedit2 libtirpc3 libepoxy0 libudev1 util-linux"

if [ -x /usr/bin/rs274 ] && [ -x /usr/bin/milltask ] && /usr/bin/python3 -c "import gcode, hal, linuxcnc" 2>/dev/null; then
    echo "LinuxCNC is already installed"
    exit 0
fi
command -v apt-get >/dev/null && command -v dpkg-deb >/dev/null || without "this system has no apt"
[ "$(id -u)" = 0 ] || without "only root can install it (run: sudo sh .ci/install_linuxcnc.sh)"

folder=$(mktemp -d) || without "no temporary folder"
trap 'rm -rf "$folder"' EXIT
chmod 755 "$folder"      # apt downloads as its own user
cd "$folder" || without "no temporary folder"
export DEBIAN_FRONTEND=noninteractive

apt-get update -qq >apt.log 2>&1 || without "apt cannot reach its package lists"
apt-cache show "$package" >/dev/null 2>&1 || without "this distribution has no package $package (Debian 12 has)"
# the simulator's control files are linked against bookworm's Python and Boost
# shellcheck disable=SC2086
apt-get install -y -qq --no-install-recommends $libraries >apt.log 2>&1 \
    || without "its libraries cannot be installed: $(tail -n 1 apt.log)"
apt-get download -qq "$package" >apt.log 2>&1 || without "the package cannot be downloaded: $(tail -n 1 apt.log)"

# Unpacked, not registered with dpkg; a real installation later overwrites the same files.
dpkg-deb --fsys-tarfile "$package"_*.deb | tar -C / -x --wildcards \
    './usr/lib/lib*.so*' ./usr/lib/linuxcnc ./usr/share/linuxcnc/linuxcnc.nml ./etc/linuxcnc \
    ./usr/bin/rs274 ./usr/bin/milltask ./usr/bin/io ./usr/bin/linuxcncsvr \
    ./usr/bin/halcmd ./usr/bin/rtapi_app ./usr/bin/linuxcnc_module_helper \
    './usr/lib/python3/dist-packages/gcode*.so' './usr/lib/python3/dist-packages/linuxcnc*.so' \
    './usr/lib/python3/dist-packages/_hal*.so' ./usr/lib/python3/dist-packages/hal.py \
    || without "the package cannot be unpacked"
chmod u-s /usr/bin/rtapi_app      # the simulator never needs to be root
ldconfig

/usr/bin/python3 -c "import gcode, hal, linuxcnc" || without "the unpacked package does not load"
echo "LinuxCNC $(dpkg-deb -f "$package"_*.deb Version) installed"
