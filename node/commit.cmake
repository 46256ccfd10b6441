# Writes OUTPUT with the commit of the sources in SOURCE, only if it has changed, so that nothing is compiled again.
# An archive without git has the commit "unknown".
execute_process(COMMAND git -C ${SOURCE} describe --always --abbrev=12 --dirty --exclude=* OUTPUT_VARIABLE commit
    OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET RESULT_VARIABLE failed)
if(failed)
    set(commit unknown)
endif()
file(CONFIGURE OUTPUT ${OUTPUT} CONTENT
    "#include \"node/version.hpp\"\nnamespace tactiled {\nconst char* const kCommit = \"${commit}\";\n}  // namespace tactiled\n")
