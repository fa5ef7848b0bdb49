# OpenVDB as the target tetpbd::openvdb, where all of it is there. Its own find module asks for more than is used here. The
# installed package finds it by this file as well.
find_path(TETPBD_OPENVDB_INCLUDE openvdb/openvdb.h)
find_path(TETPBD_BOOST_INCLUDE boost/version.hpp)
find_library(TETPBD_OPENVDB_LIBRARY openvdb)
find_library(TETPBD_TBB_LIBRARY tbb)
find_library(TETPBD_IMATH_LIBRARY NAMES Imath Imath-3_1)
mark_as_advanced(TETPBD_OPENVDB_INCLUDE TETPBD_BOOST_INCLUDE TETPBD_OPENVDB_LIBRARY TETPBD_TBB_LIBRARY TETPBD_IMATH_LIBRARY)
if(TETPBD_OPENVDB_INCLUDE AND TETPBD_BOOST_INCLUDE AND TETPBD_OPENVDB_LIBRARY AND TETPBD_TBB_LIBRARY AND TETPBD_IMATH_LIBRARY
   AND NOT TARGET tetpbd::openvdb)
  add_library(tetpbd::openvdb INTERFACE IMPORTED)
  target_include_directories(tetpbd::openvdb INTERFACE ${TETPBD_OPENVDB_INCLUDE} ${TETPBD_BOOST_INCLUDE})
  target_link_libraries(tetpbd::openvdb INTERFACE ${TETPBD_OPENVDB_LIBRARY} ${TETPBD_TBB_LIBRARY} ${TETPBD_IMATH_LIBRARY})
endif()
