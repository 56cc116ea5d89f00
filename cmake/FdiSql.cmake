# Embeds SQL into a library, as constants that the compiler sees.
#
# fdi_sql(TARGET NAMESPACE) writes the header "FOLDER/sql.h" from the files of
# the current folder:
#
#   migrations/NNNN.sql ...  become NAMESPACE::kMigrations, in order. NNNN is the
#                            version that the script leads to; the first one
#                            makes the tables and is NAMESPACE::kBaseline;
#   queries.sql              becomes one constant for each statement in it.
#
# A statement begins at a line `-- name: open_episodes` and is the constant
# NAMESPACE::open_episodes. The header is private to the library. A change of a
# .sql file configures the build anew.
function(fdi_sql target namespace)
  file(RELATIVE_PATH folder ${PROJECT_SOURCE_DIR} ${CMAKE_CURRENT_SOURCE_DIR})
  file(GLOB migrations CONFIGURE_DEPENDS migrations/*.sql)
  set(queries ${CMAKE_CURRENT_SOURCE_DIR}/queries.sql)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${migrations}
                                         ${queries})
  string(CONCAT text "#pragma once\n\n#include <array>\n"
         "#include <string_view>\n\n" "namespace fdi::storage::${namespace} {\n\n")

  list(LENGTH migrations count)
  list(GET migrations 0 baseline)
  string(REGEX REPLACE ".*/0*([0-9]+)\\.sql$" "\\1" baseline "${baseline}")
  string(APPEND text "inline constexpr int kBaseline = ${baseline};\n"
         "inline constexpr std::array<std::string_view, ${count}> "
         "kMigrations{\n")
  foreach(file ${migrations})
    file(READ ${file} sql)
    string(APPEND text "R\"sql(${sql})sql\",\n")
  endforeach()
  string(APPEND text "};\n\n")

  # Comments go first: some statements are beginnings that the program goes on
  # with. Then every name ends the constant before it and begins its own.
  file(READ ${queries} sql)
  string(REGEX REPLACE "(^|\n)-- name: " "\nNAME " sql "${sql}")
  string(REGEX REPLACE "(^|\n)--[^\n]*" "" sql "${sql}")
  string(REGEX REPLACE "\n*NAME ([a-z0-9_]+)\n"
         ")sql\";\ninline constexpr std::string_view \\1 = R\"sql(" sql "${sql}")
  string(APPEND text "[[maybe_unused]] inline constexpr std::string_view "
         "kNone = R\"sql(${sql})sql\";\n\n}  // namespace\n")

  set(root ${CMAKE_CURRENT_BINARY_DIR}/sql)
  file(CONFIGURE OUTPUT ${root}/${folder}/sql.h CONTENT "${text}" @ONLY)
  target_include_directories(${target} PRIVATE ${root})
endfunction()
