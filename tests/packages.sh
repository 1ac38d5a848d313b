#!/bin/sh
# packages.sh CPACK BUILD FOLDER: the Debian packages, their contents, and that the library's needs neither VTK nor OpenImageIO.
set -eu
cpack=$1 build=$2 folder=$3
if ! command -v dpkg-deb >/dev/null || ! command -v dpkg-shlibdeps >/dev/null; then
    echo 'skipped: no dpkg-deb or dpkg-shlibdeps here'
    exit 77
fi
rm -rf "$folder"
mkdir -p "$folder"
"$cpack" --config "$build/CPackConfig.cmake" -B "$folder" >"$folder/cpack.log" 2>&1 || {
    cat "$folder/cpack.log"
    exit 1
}
rm -rf "$folder/_CPack_Packages"
holds() {
    dpkg-deb -c "$folder"/"$1"_*.deb >"$folder/contents"
    grep -q "$2" "$folder/contents" || {
        echo "$1 does not hold $2"
        exit 1
    }
}
needs() {
    dpkg-deb -f "$folder"/"$1"_*.deb Depends | grep -q "$2" || {
        echo "$1 does not need $2"
        exit 1
    }
}
holds libinsitu0 'lib/libinsitu\.so\.0$\|lib/libinsitu\.so\.0 '
holds libinsitu-image 'libinsitu_image\.so'
holds libinsitu-dev 'include/insitu/insitu\.h'
holds libinsitu-dev 'lib/.*libinsitu\.a'
holds libinsitu-dev 'insitu\.f90'
holds libinsitu-dev 'insituConfig\.cmake'
holds libinsitu-dev 'insitu\.pc'
holds python3-insitu 'dist-packages/insitu\.py'
holds insitu-view 'bin/insitu-view'
needs libinsitu0 libopenmpi
needs libinsitu-image libopenimageio
needs libinsitu-image libfreetype6
if dpkg-deb -f "$folder"/libinsitu0_*.deb Depends | grep -q 'vtk\|openimageio'; then
    echo 'libinsitu0 needs VTK or OpenImageIO'
    exit 1
fi
if [ -e "$build/bin/insitu-render" ]; then
    holds insitu-tools bin/insitu-render
    needs insitu-tools libinsitu-vtk0
fi
