# Builds the page of `drivebench web` from a copy of its sources, so that the checkout stays clean: packages as
# package-lock.json has them, messages from bench.proto, checked types, one script. Without a network there is no page, and
# the rest of the build goes on; the next build tries again.
file(REMOVE_RECURSE ${BUILD}/src)
file(COPY ${SOURCE}/ DESTINATION ${BUILD} PATTERN node_modules EXCLUDE)
if(NOT EXISTS ${BUILD}/node_modules/.package-lock.json OR ${BUILD}/package-lock.json IS_NEWER_THAN ${BUILD}/installed)
  execute_process(COMMAND ${NPM} ci --no-audit --no-fund --ignore-scripts --loglevel=error
    WORKING_DIRECTORY ${BUILD} RESULT_VARIABLE result OUTPUT_QUIET ERROR_VARIABLE problem)
  if(result)
    message("The page of `drivebench web` is not built, npm cannot install its packages:\n${problem}")
    return()
  endif()
  file(TOUCH ${BUILD}/installed)
endif()
set(ENV{DRIVEBENCH_PROTO} ${PROTO})
set(ENV{DRIVEBENCH_PAGE} ${BUILD}/dist)
file(REMOVE_RECURSE ${BUILD}/dist)
execute_process(COMMAND ${NPM} run --silent build WORKING_DIRECTORY ${BUILD} RESULT_VARIABLE result)
if(result)
  message(FATAL_ERROR "The page of `drivebench web` has an error")
endif()
file(REMOVE_RECURSE ${PAGE})
file(COPY ${BUILD}/dist/ DESTINATION ${PAGE})
file(TOUCH ${STAMP})
