# cpack: a Debian package. cpack --config build/release/CPackConfig.cmake
set(FDI_PACKAGING ${PROJECT_SOURCE_DIR}/cmake/package)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME fdi)
set(CPACK_PACKAGE_VENDOR "fdi")
set(CPACK_PACKAGE_CONTACT "fdi maintainers <maintainers@fdi.invalid>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY
    "recognises which fault a control valve has")
set(CPACK_PACKAGE_DESCRIPTION
"A monitoring service on DDS that recognises which fault a control valve has
from a bank of fuzzy models, and keeps an evidence file of every fault episode
in SQLite.

fdi-monitor diagnoses the valves on the bus, fdi-simulator simulates or replays
valves, fdi-trainer makes the models from recorded runs, fdi-store looks after
runs, models, valves and the fault history, and fdi-gateway brings readings of a
plant in and findings out.")
set(CPACK_STRIP_FILES ON)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_PRE_BUILD_SCRIPTS ${FDI_PACKAGING}/permissions.cmake)
set(CPACK_VERBATIM_VARIABLES ON)

set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_PRIORITY optional)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
# For the user that sysusers.d names, and for fdi-keys.
set(CPACK_DEBIAN_PACKAGE_DEPENDS
    "systemd | systemd-standalone-sysusers, openssl")
set(CPACK_DEBIAN_PACKAGE_RECOMMENDS "gnuplot-nox")
set(CPACK_DEBIAN_PACKAGE_SUGGESTS "sqlite3, bash-completion, postgresql, nginx")
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_EXTRA
    ${FDI_PACKAGING}/conffiles ${FDI_PACKAGING}/postinst
    ${FDI_PACKAGING}/prerm ${FDI_PACKAGING}/postrm)

include(CPack)
