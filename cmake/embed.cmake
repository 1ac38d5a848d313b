# A file's bytes as a C array: cmake -DFILE=... -DNAME=... -DHEADER=... -DOUTPUT=... -P embed.cmake
# An array of numbers, because no compiler has to take a string literal of more than 4095 bytes.
file(READ ${FILE} bytes HEX)
string(REGEX REPLACE "(................................)" "\\1\n" bytes "${bytes}")
string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${bytes}")
file(WRITE ${OUTPUT} "#include \"${HEADER}\"\n\nconst unsigned char ${NAME}[] = {\n${bytes}\n};\n")
file(APPEND ${OUTPUT} "const size_t ${NAME}_size = sizeof ${NAME};\n")
