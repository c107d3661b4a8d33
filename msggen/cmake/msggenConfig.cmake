# The functions msggen_generate and msggen_render, which docs/cmake.md describes. `msggen --cmake-dir` prints the folder
# of this file.
cmake_minimum_required(VERSION 3.20)

find_program(MSGGEN msggen HINTS "${CMAKE_CURRENT_LIST_DIR}/../../../bin")
if(NOT MSGGEN)
  set(msggen_FOUND FALSE)
  set(msggen_NOT_FOUND_MESSAGE "no program msggen on the PATH: install msggen, or set MSGGEN to its path")
  return()
endif()

# msggen_generate(<target> [PX4 <path>] [MSG_DIRS <[pkg=]dir>...] [TOPICS <file>] [OUTPUT <dir>] [OPTIONS <option>...])
function(msggen_generate target)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "PX4;TOPICS;OUTPUT" "MSG_DIRS;OPTIONS")
  if(NOT arg_OUTPUT)
    set(arg_OUTPUT python)
  endif()
  _msggen_add_target(msggen_generate "" build --package "${target}")
endfunction()

# msggen_render(<target> TEMPLATE <file> OUTPUT <dir> [EACH <thing>] [NAME <pattern>]
#   [PX4 <path>] [MSG_DIRS <[pkg=]dir>...] [TOPICS <file>] [OPTIONS <option>...])
function(msggen_render target)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "TEMPLATE;EACH;NAME;PX4;TOPICS;OUTPUT" "MSG_DIRS;OPTIONS")
  set(options "")
  if(DEFINED arg_TEMPLATE)
    cmake_path(ABSOLUTE_PATH arg_TEMPLATE BASE_DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}" NORMALIZE)
    list(APPEND options "--template=${arg_TEMPLATE}")
  endif()
  if(DEFINED arg_EACH)
    list(APPEND options "--each=${arg_EACH}")
  endif()
  if(DEFINED arg_NAME)
    list(APPEND options "--name=${arg_NAME}")
  endif()
  _msggen_add_target(msggen_render "TEMPLATE;OUTPUT" render ${options})
endfunction()

# Add ${target}, which runs msggen with the words ARGN and the arguments that both functions share. ${target} and
# ${arg_...} are variables of ${caller}. `required` lists its arguments that have no default.
function(_msggen_add_target caller required)
  if(arg_UNPARSED_ARGUMENTS OR arg_KEYWORDS_MISSING_VALUES)
    set(wrong ${arg_UNPARSED_ARGUMENTS} ${arg_KEYWORDS_MISSING_VALUES})
    message(FATAL_ERROR "${caller}: unknown argument, or argument without a value: ${wrong}")
  endif()
  foreach(name IN LISTS required)
    if(NOT DEFINED arg_${name})
      message(FATAL_ERROR "${caller}: ${name} is missing")
    endif()
  endforeach()
  cmake_path(ABSOLUTE_PATH arg_OUTPUT BASE_DIRECTORY "${CMAKE_CURRENT_BINARY_DIR}" NORMALIZE)
  set(command "${MSGGEN}" ${ARGN} --output "${arg_OUTPUT}")
  set(folders "")
  if(DEFINED arg_PX4)
    set(tree "${arg_PX4}")
    cmake_path(ABSOLUTE_PATH tree BASE_DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}" NORMALIZE)
    if(EXISTS "${tree}")
      list(APPEND folders "${tree}")
      set(arg_PX4 "${tree}")
    endif()
    list(APPEND command --px4 "${arg_PX4}")
  endif()
  foreach(dir IN LISTS arg_MSG_DIRS)
    string(REGEX MATCH "^[a-z0-9_]+=" package "${dir}")
    string(REGEX REPLACE "^[a-z0-9_]+=" "" folder "${dir}")
    cmake_path(ABSOLUTE_PATH folder BASE_DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}" NORMALIZE)
    list(APPEND folders "${folder}")
    list(APPEND command --msg-dir "${package}${folder}")
  endforeach()
  if(DEFINED arg_TOPICS)
    cmake_path(ABSOLUTE_PATH arg_TOPICS BASE_DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}" NORMALIZE)
    list(APPEND command --topics "${arg_TOPICS}")
  endif()
  list(APPEND command ${arg_OPTIONS})

  # Adding or removing a definition changes this list, which starts msggen.
  set(patterns "")
  foreach(folder IN LISTS folders)
    foreach(place IN ITEMS "" msg/ msg/versioned/ srv/)
      list(APPEND patterns "${folder}/${place}*.msg" "${folder}/${place}*.srv")
    endforeach()
  endforeach()
  set(definitions "")
  if(patterns)
    file(GLOB definitions CONFIGURE_DEPENDS ${patterns})
  endif()
  set(inventory "${CMAKE_CURRENT_BINARY_DIR}/${target}.definitions")
  file(CONFIGURE OUTPUT "${inventory}" CONTENT "${definitions}\n" @ONLY)

  execute_process(
    COMMAND ${command} --list-outputs
    WORKING_DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}"
    OUTPUT_VARIABLE outputs
    OUTPUT_STRIP_TRAILING_WHITESPACE
    COMMAND_ERROR_IS_FATAL ANY)
  string(REPLACE "\n" ";" outputs "${outputs}")
  list(POP_FRONT outputs marker)

  set(depfile "${CMAKE_CURRENT_BINARY_DIR}/${target}.d")
  add_custom_command(
    OUTPUT "${marker}"
    BYPRODUCTS ${outputs}
    COMMAND ${command} --quiet --depfile "${depfile}"
    COMMAND "${CMAKE_COMMAND}" -E touch "${marker}"
    WORKING_DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}"
    DEPENDS "${inventory}"
    DEPFILE "${depfile}"
    COMMENT "Generating ${target}"
    VERBATIM)
  add_custom_target("${target}" ALL DEPENDS "${marker}")
endfunction()
