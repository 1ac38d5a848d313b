#!/bin/sh
# house_includes.sh ROOT: arrows between rooms go down only, the core is C, no two files have the same name, and one file
# opens all others.
#
# Names are unique, so an include's last part says which room it enters. What a room may enter is the table below.
set -eu
cd "$1"
rooms=''
for room in libinsitu mmbvh render compositing adaptors mini-app tools bench tests examples cmake; do
    if [ -d "$room" ]; then rooms="$rooms $room"; fi
done
# shellcheck disable=SC2086 # a list
files=$(find $rooms -type f \( -name '*.[ch]' -o -name '*.cpp' -o -name '*.hpp' -o -name '*.cc' -o -name '*.cxx' \
    -o -name '*.f90' -o -name '*.F90' -o -name '*.cmake' -o -name '*.sh' \) | LC_ALL=C sort)

printf '%s\n' "$files" | awk '
function room_of(path, parts) {
    split(path, parts, "/")
    if (path ~ /^libinsitu\/include\//) return "public"
    if (path ~ /^adaptors\/[^\/]*\/include\//) return "adaptor_headers"
    if (path ~ /^libinsitu\/session\/[a-z]+\//) return parts[3]
    if (parts[1] == "libinsitu") return parts[2]
    if (path ~ /^render\/render(_isa)?\.h$/) return "render_face"
    if (path ~ /^render\/[a-z]+\//) return parts[2]
    return parts[1]
}
function complain(text) {
    print text
    complaints++
}
function check_include(path, line, number, room, name, last, quoted, target) {
    quoted = line ~ /^[ \t]*#[ \t]*include[ \t]*"/
    if (!match(line, /["<][^">]*[">]/)) return
    name = substr(line, RSTART + 1, RLENGTH - 2)
    last = name
    sub(/.*\//, "", last)
    if (room ~ /^(base|mmbvh|scene|render|render_face|rays|cells|find|surface|volume)$/ && (name == "mpi.h" || name == "insitu/insitu.h"))
        complain(path ":" number ": " room " knows no MPI, yet includes " name)
    if (room in allowed && room !~ /^(adaptors|adaptor_headers|tools)$/ && name ~ /^(vtk[A-Z]|OpenImageIO\/)/)
        complain(path ":" number ": " room " includes " name ", which belongs behind an adaptor")
    if (!quoted && !(name in file_of) && (!(last in file_of) || name ~ /\//) && name !~ /^insitu\//) return
    if (!(last in file_of)) {
        complain(path ":" number ": no file of the tree is called " last)
        return
    }
    if (!quoted && name !~ /^insitu\//) complain(path ":" number ": " name " is ours: include it with quotes")
    target = room_of(file_of[last])
    if (room in allowed && target != room && index(allowed[room], " " target " ") == 0)
        complain(path ":" number ": " room " must not include " name " of " target)
}
BEGIN {
    allowed["public"] = " "
    allowed["base"] = " public "
    allowed["mmbvh"] = " base public "
    allowed["render_face"] = " mmbvh base public "
    allowed["rays"] = " render_face mmbvh base public "
    allowed["cells"] = " rays" allowed["rays"]
    allowed["find"] = " cells" allowed["cells"]
    allowed["surface"] = " find" allowed["find"]
    allowed["volume"] = " find" allowed["find"]
    allowed["render"] = " surface volume find" allowed["find"]
    allowed["compositing"] = " base public "
    allowed["scene"] = " render base public "
    allowed["common"] = " base public "
    allowed["lanes"] = " base public "
    allowed["meshes"] = " lanes common mmbvh base public "
    allowed["scalars"] = " meshes scene common mmbvh base public "
    allowed["outer"] = " scalars meshes scene common mmbvh base public "
    allowed["statistics"] = " scalars meshes scene common mmbvh base public "
    allowed["plan"] = " statistics outer scalars meshes scene render render_face common mmbvh base public "
    allowed["cinema"] = " scene common base public "
    allowed["views"] = " plan" allowed["plan"]
    allowed["decorations"] = " views" allowed["views"]
    allowed["pictures"] = " decorations cinema compositing" allowed["decorations"]
    allowed["session"] = " pictures" allowed["pictures"]
    allowed["adaptor_headers"] = " public "
    allowed["adaptors"] = " adaptor_headers public "
    allowed["tools"] = " adaptor_headers public "
    allowed["mini-app"] = " public "
    allowed["examples"] = " adaptor_headers public "
}
{
    paths[++count] = $0
    last = $0
    sub(/.*\//, "", last)
    if (last in file_of) complain($0 ": has the same name as " file_of[last])
    file_of[last] = $0
    if ($0 ~ /^(libinsitu|mmbvh|render|compositing)\/.*\.(cpp|hpp|cc|cxx)$/) complain($0 ": the core is C")
}
END {
    for (i = 1; i <= count; i++) {
        if (paths[i] !~ /\.(c|h|cpp|hpp|cc|cxx)$/) continue
        number = 0
        while ((getline line < paths[i]) > 0) {
            number++
            if (paths[i] ~ /^libinsitu\// && paths[i] != "libinsitu/base/file.c" &&
                line ~ /(^|[^A-Za-z0-9_])(fopen|freopen|fdopen|open|openat|creat|opendir|tmpfile)[ \t]*\(/)
                complain(paths[i] ":" number ": opens a file, which libinsitu/base/file.c alone may do")
            if (line !~ /^[ \t]*#[ \t]*include/) continue
            includes++
            check_include(paths[i], line, number, room_of(paths[i]))
        }
        close(paths[i])
    }
    if (includes == 0) complain("no include was read: the test looks in the wrong place")
    exit complaints > 0
}'
