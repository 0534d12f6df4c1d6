# CPack reads this when the packages' files are in their folders and before it packs them: dates what it
# packs as the changelog, and lists it.
set(ENV{SOURCE_DATE_EPOCH} ${CPACK_PREVIZ_EPOCH})
foreach(component ${CPACK_COMPONENTS_ALL})
  string(TOUPPER ${component} upper)
  execute_process(COMMAND ${CPACK_PREVIZ_SPDX} --package ${CPACK_DEBIAN_${upper}_PACKAGE_NAME}
                          ${CPACK_PACKAGE_VERSION} ${CPACK_TEMPORARY_DIRECTORY}/${component}
                  COMMAND_ERROR_IS_FATAL ANY)
endforeach()
