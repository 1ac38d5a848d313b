#!/bin/sh
# package_chroot.sh CPACK BUILD SOURCE FOLDER: a bare Debian in FOLDER, into which the packages of BUILD are installed by apt,
# builds the example programs of SOURCE in C, C++17 and Fortran, by CMake and by pkg-config, and the tutorial's, and runs
# them and Python's on two ranks. As root; 77, which ctest takes for skipped, where debootstrap or its archive is not to be had.
set -eu
cpack=$1 build=$2 source=$3 folder=$4 packages=$4.packages
skip() {
    echo "skipped: $*"
    exit 77
}
[ "$(id -u)" = 0 ] || skip 'a chroot takes root'
command -v debootstrap >/dev/null || skip 'debootstrap is not installed'
"$(dirname "$0")/packages.sh" "$cpack" "$build" "$packages"
rm -rf "$folder"
mkdir -p "$folder"
trap 'umount "$folder/proc" 2>/dev/null || true; rm -rf "$folder"' EXIT
debootstrap --variant=minbase bookworm "$folder" >"$folder.log" 2>&1 || {
    tail -n 5 "$folder.log"
    skip 'debootstrap made no Debian'
}
mount -t proc proc "$folder/proc"
mkdir "$folder/packages" "$folder/work"
cp "$packages"/*.deb "$folder/packages"
cp "$source"/examples/six_calls.c "$source"/examples/six_calls.cpp "$source"/examples/six_calls.f90 \
    "$source"/examples/six_calls.py "$source"/examples/finite_volume.c "$folder/work"
cp "$source/examples/six_calls.yaml" "$folder/work/scene.yaml"
cp -r "$source/examples/tutorial" "$folder/work"
cat >"$folder/work/run.sh" <<'END'
set -eux
export DEBIAN_FRONTEND=noninteractive OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
export OMPI_MCA_rmaps_base_oversubscribe=1 OMPI_MCA_btl=self,tcp
apt-get -qq update
apt-get -qq -y install --no-install-recommends /packages/libinsitu0*.deb /packages/libinsitu-image*.deb \
    /packages/libinsitu-dev*.deb /packages/python3-insitu*.deb fonts-dejavu-core >/dev/null
[ ! -e /usr/lib/x86_64-linux-gnu/libvtkCommonCore-9.1.so.1 ] # none of it needs VTK
apt-get -qq -y install --no-install-recommends g++ gfortran cmake make pkg-config openmpi-bin >/dev/null
cd /work
mkdir c cpp fortran python project
mpicc six_calls.c -o c/program $(pkg-config --cflags --libs insitu) -lm
mpicxx -std=c++17 six_calls.cpp -o cpp/program $(pkg-config --cflags --libs insitu)
mpifort /usr/include/insitu/insitu.f90 six_calls.f90 -o fortran/program $(pkg-config --libs insitu)
cat >CMakeLists.txt <<'LISTS'
cmake_minimum_required(VERSION 3.16)
project(user LANGUAGES C)
find_package(insitu REQUIRED)
add_executable(finite_volume finite_volume.c)
target_link_libraries(finite_volume PRIVATE insitu::insitu m)
LISTS
cmake -S . -B project/build >/dev/null
cmake --build project/build >/dev/null
for program in c/program cpp/program fortran/program "python3 six_calls.py" project/build/finite_volume; do
    rm -rf pictures
    mpirun -n 2 $program
    find . -name '*.png' | grep . && find . -name '*.png' -delete
done
cd tutorial
mpicc heat.c $(pkg-config --cflags --libs insitu) -lm -o heat_c
mpifort $(pkg-config --variable=includedir insitu)/insitu/insitu.f90 heat.f90 $(pkg-config --libs insitu) -o heat_fortran
for program in ./heat_c ./heat_fortran "python3 heat.py"; do
    mpirun -n 2 $program
    rm heat_00.png heat_03.png heat_06.png heat_09.png
done
cd ..
apt-get -qq -y install --no-install-recommends /packages/insitu-tools*.deb \
    /packages/libinsitu-vtk0*.deb >/dev/null
insitu-render --help >/dev/null
apt-get -qq -y remove libinsitu0 >/dev/null
[ ! -e /usr/lib/libinsitu.so.0 ]
END
# Nothing of this environment but the way to the archive.
env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root ${http_proxy:+http_proxy="$http_proxy"} \
    ${https_proxy:+https_proxy="$https_proxy"} chroot "$folder" /bin/sh /work/run.sh
echo 'The packages serve programs in C, C++, Fortran and Python.'
