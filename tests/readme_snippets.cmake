# cmake -DROOT=<source tree> -P readme_snippets.cmake: what the README shows of a file is the file, to the byte.
function(expect_shown language file)
  file(READ ${ROOT}/README.md readme)
  file(READ ${ROOT}/${file} text)
  string(FIND "${readme}" "```${language}\n${text}```\n" at)
  if(at EQUAL -1)
    message(SEND_ERROR "README.md does not show ${file} as it is, in a block of ${language}")
  endif()
endfunction()

expect_shown(c examples/six_calls.c)
expect_shown(yaml examples/six_calls.yaml)

# What docs/finite_volume.md shows is part of the example.
file(READ ${ROOT}/docs/finite_volume.md page)
file(READ ${ROOT}/examples/finite_volume.c text)
string(REGEX MATCH "```c\n([^`]+)```" block "${page}")
string(FIND "${text}" "${CMAKE_MATCH_1}" at)
if(NOT block OR at EQUAL -1)
  message(SEND_ERROR "docs/finite_volume.md shows what is not in examples/finite_volume.c")
endif()
