// SPDX-License-Identifier: Apache-2.0
#include "calib/boards/sighting_file.h"
#include "calib/boards/vnl_file.h"
#include "calib/files/calibration_check_file.h"
#include "calib/files/calibration_session_file.h"
#include "calib/files/camera_file.h"
#include "calib/files/foreign_camera_file.h"
#include "calib/poses/pose_files.h"
#include "calib/poses/pose_pairs.h"
#include "calib/robot/robot_model.h"
#include "tests/folders.h"
#include "tests/robustness/parsers/targets.h"
#include "tests/server/test_cell.h"
#include "tools/cell/cell.h"

namespace silhouette {
namespace {

std::string TextOf(const std::string& path) {
  std::ifstream in(SourceFolder() + "/" + path);
  return {std::istreambuf_iterator<char>(in), {}};
}

// The bytes as a file, always the same one.
std::string FileOf(std::string_view bytes, const std::string& name) {
  static const std::filesystem::path folder = FreshFolder();
  std::ofstream(folder / name, std::ios::binary) << bytes;
  return folder / name;
}

void ParseCell(std::string_view bytes) { LoadCell(FileOf(bytes, "cell.yaml")).IgnoreError(); }
std::vector<std::string> CellSeeds() { return {TextOf("docs/cell.yaml")}; }

void ParseUrdfFile(std::string_view bytes) {
  RobotModel::FromUrdf(FileOf(bytes, "robot.urdf")).IgnoreError();
}
std::vector<std::string> UrdfSeeds() {
  return {
      TextOf("capture/sim/robots/rx130.urdf"),
      R"(<robot name="r"><link name="a"><visual><geometry><box size="1 2 3"/></geometry></visual>
</link><link name="b"/><joint name="j" type="revolute"><parent link="a"/><child link="b"/>
<origin xyz="0 0 1" rpy="0 1 0"/><axis xyz="0 1 0"/><limit lower="-1" upper="1"/></joint></robot>)",
      R"(<robot name="r"><link name="a"/><link name="b"/><link name="c"/>
<joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint>
<joint name="k" type="prismatic"><parent link="b"/><child link="c"/><limit lower="0" upper="1"/>
<mimic joint="j" multiplier="2" offset="1"/></joint></robot>)"};
}

void ParseCamera(std::string_view bytes) {
  const std::string text(bytes);
  CameraFromText(text, "file").IgnoreError();
  StoredCameraFromText(text, "file").IgnoreError();
  LensRegionFromText(text, "file").IgnoreError();
  CameraFromForeignText(text, "file").IgnoreError();
  CameraFromForeignText(text, "file", {.image_size = {{640, 480}}, .camera = "cam1"}).IgnoreError();
}
std::vector<std::string> CameraSeeds() {
  return {
      CameraFileText("LENSMODEL_OPENCV8", {500, 501, 320, 240, .1, .2, .003, .004, .5, .6, .7, .8},
                     640, 480, Eigen::Isometry3d::Identity(), "top",
                     LensRegion{.contour = {{1, 2}, {600, 3}, {20, 400}, {1, 2}}, .sigma = 0.9}),
      "%YAML:1.0\n---\nimage_width: 1280\nimage_height: 960\ncamera_matrix: !!opencv-matrix\n"
      "   rows: 3\n   cols: 3\n   dt: d\n   data: [ 905, 0., 645.5, 0., 902, 470, 0., 0., 1. ]\n"
      "distortion_coefficients: !!opencv-matrix\n   rows: 5\n   cols: 1\n   dt: d\n"
      "   data: [ -0.1, 0.2, 0.001, 0.002, 0.03 ]\n",
      "<?xml version=\"1.0\"?>\n<opencv_storage><image_width>640</image_width>"
      "<image_height>480</image_height><camera_matrix type_id=\"opencv-matrix\"><rows>3</rows>"
      "<cols>3</cols><dt>d</dt><data>500 0 320 0 500 240 0 0 1</data></camera_matrix>"
      "<distortion_coefficients type_id=\"opencv-matrix\"><rows>1</rows><cols>5</cols><dt>d</dt>"
      "<data>0 0 0 0 0</data></distortion_coefficients></opencv_storage>\n",
      "image_width: 640\nimage_height: 480\ncamera_name: a\ncamera_matrix:\n  rows: 3\n  cols: 3\n"
      "  data: [500, 0, 320, 0, 501, 240, 0, 0, 1]\ndistortion_model: plumb_bob\n"
      "distortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [0.1, 0.2, 0.003, 0.004, 0.5]\n",
      "cam0:\n  camera_model: pinhole\n  distortion_coeffs: [-0.2, 0.07, 0.0002, 1.7e-05]\n"
      "  distortion_model: equidistant\n  intrinsics: [458.6, 457.3, 367.2, 248.4]\n"
      "  resolution: [752, 480]\n"};
}

void ParseCalibration(std::string_view bytes) {
  const std::string text(bytes);
  const storage::v1::CellDescription cell = ServerTestCell();
  CheckFromText(text, "file").IgnoreError();
  try {
    IsSessionFile(text);
  } catch (const std::runtime_error&) {
  }
  SessionFromText(text, "file", cell).IgnoreError();
  MatricesFromText(text, "file", cell).IgnoreError();
}
std::vector<std::string> CalibrationSeeds() {
  const storage::v1::CellDescription cell = ServerTestCell();
  return {
      MatrixFileText(TestCalibration(), cell),
      SessionFileText({.calibration = TestCalibration(), .camera_files = {}}, cell),
      CheckFileText(
          {.time = absl::UnixEpoch(),
           .calibration = "0123456789abcdef",
           .limit_mask_px = 0.25,
           .views = {{.name = "left", .method = "tags", .checked = true, .message = "moved"}}})};
}

// The first byte says of what kind the table is.
void ParseCorners(std::string_view bytes) {
  static const Board board(
      {.name = "hand", .kind = BoardKind::kCircles, .rows = 2, .columns = 3, .square = 0.025});
  if (bytes.empty()) return;
  const std::string text(bytes.substr(1));
  if (bytes[0] == 'c') SightingsFromText(text, "file").IgnoreError();
  if (bytes[0] == 'v') SightingsFromVnl(text, "file", board).IgnoreError();
  if (bytes[0] != 'b') return;
  const auto boards = BoardsFromText(text, "file");
  if (!boards.ok()) return;
  for (const Board& read : *boards) {
    read.CornersOf(read.first_mark());
    read.lattice();
  }
}
std::vector<std::string> CornersSeeds() {
  return {
      "cframe,view,family,tag,corner,x,y,sigma\n\"7\",left,chessboard-3x2,1,0,311.06,208.9,0.01\n",
      "cframe,view,family,tag,corner,x,y,sigma,width,height\n7,left,t,1,0,3,4,0.01,640,480\n",
      "v# filename x y level\na.png 1 2 0\na.png 2 2 0\na.png 3 2 -\na.png 1 3 1\na.png - - -\n"
      "a.png 3 3 0\n",
      "v# filename x y weight\na.png 1 2 0.5\n",
      "b- {name: wall, rows: 4, columns: 6, tag_size: 0.04, gap: 0.04, first_row: bottom}\n"
      "- {name: hand, chessboard: 9x6, square: 0.025}\n"
      "- {name: plate, charuco: 7x5, square: 0.04, marker: 0.03, dictionary: DICT_5X5_100}\n",
      "btarget_type: aprilgrid\ntagCols: 6\ntagRows: 6\ntagSize: 0.088\ntagSpacing: 0.3\n"};
}

void ParsePoses(std::string_view bytes) {
  const std::string text(bytes);
  PosePairsFromText(text, "file").IgnoreError();
  SurveyFromText(text, "file").IgnoreError();
  for (const std::string notation : {"quaternion", "matrix", "kuka", "tum"}) {
    RobotPosesFromText(text, "file",
                       *PoseNotation::Named(notation, notation == "matrix" ? "mm" : ""))
        .IgnoreError();
  }
}
std::vector<std::string> PosesSeeds() {
  return {
      "frame,tx,ty,tz,qx,qy,qz,qw\n0007,0.41,-0.12,0.63,0.7071,0.7071,0,0\n",
      R"({"0007": [[0, -1, 0, 0.4], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]})",
      R"([{"frame": 7, "tx": 0.4, "ty": 0, "tz": 0, "qx": 0, "qy": 0, "qz": 0, "qw": 1}])",
      "- effector_wrt_world: [0, -1, 0, 0.4, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n"
      "  object_wrt_sensor: [1, 0, 0, 0.1, 0, 1, 0, 0, 0, 0, 1, 1, 0, 0, 0, 1]\n",
      "samples:\n- robot:\n    translation: {x: 0.1, y: 0, z: 1}\n"
      "    rotation: {x: 0, y: 0, z: 0, w: 1}\n"
      "  tracking:\n    translation: {x: 0.1, y: 0, z: 1}\n"
      "    rotation: {x: 0, y: 0, z: 0, w: 1}\n",
      "- {board: a, position: [0.4, -0.2, 0], rotation: [180 deg, 0, 0], position_sigma: 1 mm}\n"};
}

constexpr FuzzTarget kFileTargets[] = {
    {"cell", ParseCell, CellSeeds},          {"urdf", ParseUrdfFile, UrdfSeeds},
    {"camera", ParseCamera, CameraSeeds},    {"calibration", ParseCalibration, CalibrationSeeds},
    {"corners", ParseCorners, CornersSeeds}, {"poses", ParsePoses, PosesSeeds},
};

}  // namespace

std::span<const FuzzTarget> FileTargets() { return kFileTargets; }

}  // namespace silhouette
