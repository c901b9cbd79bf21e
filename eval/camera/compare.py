"""Compares tags, corners and poses of `darm-camera` with pupil-apriltags and OpenCV.

    cargo run -p darm-camera --features render --example evaluate -- pictures FOLDER 200 1
    python3 eval/camera/compare.py pictures FOLDER
    python3 eval/camera/compare.py photographs FOLDER < lines of `evaluate found IMAGE ...`
    python3 eval/camera/compare.py calibration FOLDER      # of `evaluate views FOLDER SEED`

Needs numpy, pupil-apriltags and opencv-python-headless. Coordinates: the centre of the first pixel is (0, 0); those of
pupil-apriltags are moved by half a pixel. Corners are in the order -x-y, +x-y, +x+y, -x+y of the tag (y up).
"""

import csv
import sys
import time
from pathlib import Path

import cv2
import numpy as np
from pupil_apriltags import Detector

# The lens of the rendered pictures, `Optics::webcam`; its principal point is in the file, for they are parts of its picture.
FOCAL_PX = [900.0, 902.0]
DISTORTION = np.array([-0.12, 0.03, 6e-4, -4e-4])
SIDE_M = 0.05


def rows(path):
    """Rows (name, id, corners of shape (4, 2), rest) of a file of corners."""
    with open(path) as file:
        for row in csv.reader(line.split("#")[0] for line in file):
            yield row[0], int(row[1]), np.array(row[2:10], float).reshape(4, 2), [x for x in row[10:]]


class Pupil:
    name = "pupil-apriltags"

    def __init__(self):
        self.detector = Detector(families="tag36h11", nthreads=1)

    def __call__(self, image):
        return [(tag.tag_id, tag.corners - 0.5) for tag in self.detector.detect(image)]


class OpenCv:
    def __init__(self, refinement):
        self.name = f"OpenCV aruco, {refinement}"
        parameters = cv2.aruco.DetectorParameters()
        parameters.cornerRefinementMethod = getattr(cv2.aruco, f"CORNER_REFINE_{refinement}")
        family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
        self.detector = cv2.aruco.ArucoDetector(family, parameters)

    def __call__(self, image):
        corners, ids, _ = self.detector.detectMarkers(image)
        # Clockwise from the upper left, and turned by 180 degrees against the AprilTag library's drawing.
        return [] if ids is None else [(int(i), c[0][[1, 0, 3, 2]]) for i, c in zip(ids.ravel(), corners)]


def nearest(found, tag, truth):
    """Corners of a tag found nearest to where it is, or None."""
    same = [corners for number, corners in found if number == tag]
    distance = lambda corners: np.linalg.norm(corners.mean(0) - truth.mean(0))
    best = min(same, key=distance, default=None)
    return best if best is not None and distance(best) < 20 else None


def pose_error(corners, centre_px, truth_pose):
    """Position error in m and orientation error in rad of the pose that fits corners best."""
    k = np.array([[FOCAL_PX[0], 0, centre_px[0]], [0, FOCAL_PX[1], centre_px[1]], [0, 0, 1]])
    h = SIDE_M / 2
    points = np.array([[-h, -h, 0], [h, -h, 0], [h, h, 0], [-h, h, 0]])
    order = [3, 2, 1, 0]  # what SOLVEPNP_IPPE_SQUARE wants
    ok, rotation, position, _ = cv2.solvePnPGeneric(
        points[order], corners[order].reshape(-1, 1, 2).astype(float), k, DISTORTION, flags=cv2.SOLVEPNP_IPPE_SQUARE)
    if not ok:
        return np.inf, np.inf
    r, p = cv2.solvePnPRefineLM(points, corners.reshape(-1, 1, 2).astype(float), k, DISTORTION, rotation[0], position[0])
    return between(np.concatenate([r.ravel(), p.ravel()]), truth_pose)


def between(pose, truth):
    turn = cv2.Rodrigues(pose[:3])[0] @ cv2.Rodrigues(truth[:3])[0].T
    return np.linalg.norm(pose[3:] - truth[3:]), np.linalg.norm(cv2.Rodrigues(turn)[0])


def pictures(folder):
    truth = list(rows(folder / "truth.csv"))
    ours = {}
    for name, tag, corners, _ in rows(folder / "ours.csv"):
        ours.setdefault(name, []).append((tag, corners))
    methods = [Pupil(), OpenCv("NONE"), OpenCv("SUBPIX"), OpenCv("APRILTAG")]
    found = {"darm": ours} | {method.name: {} for method in methods}
    seconds = {method.name: 0.0 for method in methods}
    cv2.setNumThreads(1)
    names = sorted({row[0] for row in truth})
    for name in names:
        image = cv2.imread(str(folder / name), cv2.IMREAD_GRAYSCALE)
        for method in methods:
            start = time.perf_counter()
            found[method.name][name] = method(image)
            seconds[method.name] += time.perf_counter() - start
    own_poses = {}
    with open(folder / "poses.csv") as file:
        for row in csv.reader(file):
            own_poses[row[0], int(row[1])] = np.array(row[2:8], float)
    corners = {name: [nearest(tags.get(row[0], []), row[1], row[2]) for row in truth] for name, tags in found.items()}
    common = [k for k in range(len(truth)) if all(corners[m][k] is not None for m in ("darm", "pupil-apriltags"))]
    print(f"{len(names)} pictures, {len(truth)} tags; corner errors over tags that darm and pupil-apriltags find: {len(common)}")
    for name, tags in found.items():
        hits = sum(c is not None for c in corners[name])
        false = sum(len(t) for t in tags.values()) - hits
        errors = np.array([corners[name][k] - truth[k][2] for k in common if corners[name][k] is not None])
        distances = np.linalg.norm(errors, axis=2).ravel()
        poses = [pose_error(corners[name][k], np.array(truth[k][3][:2], float), np.array(truth[k][3][2:8], float)) for k in common if corners[name][k] is not None]
        mm, mrad = 1e3 * np.median([p[0] for p in poses]), 1e3 * np.median([p[1] for p in poses])
        rate = f", {len(names) / seconds[name]:.0f} pictures/s" if name in seconds else ""
        print(f"{name}: found {100 * hits / len(truth):.1f} %, false {false}; corners rms {np.sqrt((errors ** 2).mean()):.4f} px"
              f" an axis, median {np.median(distances):.4f}, 95 % {np.quantile(distances, 0.95):.4f}, "
              f"99 % {np.quantile(distances, 0.99):.4f}; pose by OpenCV: median {mm:.3f} mm, {mrad:.2f} mrad{rate}")
    poses = [between(own_poses[truth[k][0], truth[k][1]], np.array(truth[k][3][2:8], float))
             for k in common if (truth[k][0], truth[k][1]) in own_poses]
    print(f"darm's own poses: {len(poses)}, median {1e3 * np.median([p[0] for p in poses]):.3f} mm, "
          f"{1e3 * np.median([p[1] for p in poses]):.2f} mrad")


def photographs(folder):
    ours = {}
    for row in csv.reader(sys.stdin):
        ours.setdefault(Path(row[0]).stem, []).append((int(row[1]), np.array(row[2:10], float).reshape(4, 2), row[10]))
    for path in sorted(folder.glob("*.jpg")):
        published = []
        for line in path.with_suffix(".txt").read_text().splitlines():
            numbers = line.replace("(", "").replace(")", "").replace(",", " ").split()
            published.append((int(numbers[0]), np.array(numbers[1:9], float).reshape(4, 2) - 0.5))
        image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        both = [("darm", [(t, c) for t, c, _ in ours.get(path.stem, [])]), ("pupil-apriltags", Pupil()(image)),
                ("OpenCV aruco, APRILTAG", OpenCv("APRILTAG")(image))]
        for name, tags in both:
            hits, errors = 0, []
            for tag, corners in published:
                same = [c for t, c in tags if t == tag and np.linalg.norm(c.mean(0) - corners.mean(0)) < 5]
                hits += bool(same)
                if same:
                    errors.append(np.linalg.norm(same[0] - corners, axis=1).max())
            errors = np.array(errors or [np.nan])
            print(f"{path.stem} {name}: {hits} of {len(published)} published, {len(tags) - hits} others; largest corner difference "
                  f"median {np.median(errors):.2f}, within 0.5 px {(errors <= 0.5).sum()}, largest {errors.max():.2f} px")


def calibration(folder):
    views = {}
    with open(folder / "corners.csv") as file:
        for row in csv.reader(file):
            views.setdefault(row[0], []).append([float(x) for x in row[1:]])
    views = [np.array(view) for view in views.values()]
    points = [np.column_stack([view[:, :2], np.zeros(len(view))]).astype(np.float32) for view in views]
    seen = [view[:, 2:4].astype(np.float32) for view in views]
    rms, k, distortion, _, _ = cv2.calibrateCamera(points, seen, (1280, 720), None, None, flags=cv2.CALIB_FIX_K3)
    print(f"OpenCV on the same corners: reprojection {rms:.5f} px; {k[0, 0]:.4f} {k[1, 1]:.4f} {k[0, 2]:.4f} {k[1, 2]:.4f} {distortion.ravel()}")
    for detector in (Pupil(),):
        own, size = [], []
        for path in sorted(folder.glob("*.png")):
            image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
            index = {row: None for row in range(25)}
            for tag, corners in detector(image):
                if tag < 25:
                    index[tag] = corners
            model, pixels = [], []
            for tag, corners in index.items():
                if corners is None:
                    continue
                x, y = (tag % 5 - 2) * 0.036, (2 - tag // 5) * 0.036
                for (dx, dy), pixel in zip([(-1, -1), (1, -1), (1, 1), (-1, 1)], corners):
                    model.append([x + dx * 0.0135, y + dy * 0.0135, 0])
                    pixels.append(pixel)
            own.append(np.array(model, np.float32))
            size.append(np.array(pixels, np.float32))
        rms, k, distortion, _, _ = cv2.calibrateCamera(own, size, (1280, 720), None, None, flags=cv2.CALIB_FIX_K3)
        print(f"OpenCV on corners of {detector.name}: reprojection {rms:.5f} px; {k[0, 0]:.4f} {k[1, 1]:.4f} {k[0, 2]:.4f} {k[1, 2]:.4f} {distortion.ravel()}")


if __name__ == "__main__":
    tasks = {"pictures": pictures, "photographs": photographs, "calibration": calibration}
    if len(sys.argv) != 3 or sys.argv[1] not in tasks:
        sys.exit(__doc__)
    tasks[sys.argv[1]](Path(sys.argv[2]))
