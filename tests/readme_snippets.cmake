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
