// Times Pinocchio on the models and postures that stand on the standard input, as numbers between blanks:
// count of models; each: name, joints, gravity field, then per joint parent (-1: base), 1 when revolute, axis,
// rotation by rows, position, mass, centre of mass, inertia about it by rows; end joint, rotation, position;
// count of postures; each: positions, velocities, accelerations; count of targets of inverse kinematics; when there are any, the lower and the upper
// limits of all joints, and each target: where to start from, rotation by rows, position.
// Prints: model, work, least ns, median ns, a sum of results; of inverse kinematics the mean and the 99th percentile, ns, and how many were reached.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <iostream>
#include <random>
#include <string>
#include <vector>

#include <pinocchio/multibody.hpp>
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/center-of-mass.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/frames.hpp>
#include <pinocchio/algorithm/jacobian.hpp>
#include <pinocchio/algorithm/kinematics.hpp>
#include <pinocchio/algorithm/regressor.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/spatial.hpp>

namespace pin = pinocchio;
using Column = Eigen::VectorXd;

static double number() { double x; std::cin >> x; return x; }
static Eigen::Vector3d vector() { double x = number(), y = number(), z = number(); return {x, y, z}; }
static Eigen::Matrix3d matrix() { Eigen::Matrix3d m; for (int r = 0; r < 3; r++) m.row(r) = vector(); return m; }

static pin::JointIndex add(pin::Model &model, int parent, bool revolute, const Eigen::Vector3d &axis, const pin::SE3 &placement) {
  const std::string name = "j" + std::to_string(model.njoints);
  if (!revolute) return model.addJoint(parent, pin::JointModelPrismaticUnaligned(axis), placement, name);
  if (axis.z() == 1) return model.addJoint(parent, pin::JointModelRZ(), placement, name);
  if (axis.y() == 1) return model.addJoint(parent, pin::JointModelRY(), placement, name);
  if (axis.x() == 1) return model.addJoint(parent, pin::JointModelRX(), placement, name);
  return model.addJoint(parent, pin::JointModelRevoluteUnaligned(axis), placement, name);
}

static pin::Model read_model() {
  pin::Model model;
  const int joints = int(number());
  model.gravity.linear() = vector();
  for (int i = 0; i < joints; i++) {
    const int parent = int(number()) + 1;
    const bool revolute = number() == 1;
    const Eigen::Vector3d axis = vector();
    const Eigen::Matrix3d rotation = matrix();
    const Eigen::Vector3d position = vector();
    const auto joint = add(model, parent, revolute, axis, pin::SE3(rotation, position));
    const double mass = number();
    const Eigen::Vector3d com = vector();
    model.appendBodyToJoint(joint, pin::Inertia(mass, com, matrix()), pin::SE3::Identity());
  }
  const int end = int(number()) + 1;
  const Eigen::Matrix3d rotation = matrix();
  model.addFrame(pin::Frame("end", end, 0, pin::SE3(rotation, vector()), pin::OP_FRAME));
  return model;
}

template <class Work>
static void time(const std::string &model, const char *name, int postures, Work work) {
  std::vector<double> all;
  double sum = 0;
  for (int run = 0; run < 60; run++) {
    sum = 0;
    const auto start = std::chrono::steady_clock::now();
    for (int i = 0; i < postures; i++) sum += work(i);
    all.push_back(std::chrono::duration<double, std::nano>(std::chrono::steady_clock::now() - start).count() / postures);
  }
  std::sort(all.begin(), all.end());
  std::printf("%s %s %.1f %.1f %.17g\n", model.c_str(), name, all[0], all[all.size() / 2], sum);
  std::fflush(stdout);
}

struct Target {
  Column start;
  pin::SE3 pose;
};

// Damped closed-loop inverse kinematics as Pinocchio's example has it, except that positions and Jacobian take one pass, not two;
// clamped to the limits, with random restarts for 5 ms.
struct Clik {
  const pin::Model &model;
  pin::Data &data;
  pin::FrameIndex end;
  Column low, high;
  Eigen::Matrix<double, 6, Eigen::Dynamic> J, Jd;

  pin::SE3 error(const Column &q, const Target &target) {
    pin::computeJointJacobians(model, data, q);
    pin::updateFramePlacement(model, data, end);
    return data.oMf[end].actInv(target.pose);
  }

  static bool reached(const pin::SE3 &E) { return E.translation().norm() < 1e-5 && pin::log3(E.rotation()).norm() < 1e-5; }

  bool descend(Column &q, const Target &target) {
    for (int step = 0; step < 30; step++) {
      const pin::SE3 E = error(q, target);
      if (reached(E)) return true;
      const Eigen::Matrix<double, 6, 1> e = pin::log6(E).toVector();
      pin::getFrameJacobian(model, data, end, pin::LOCAL, J);
      Eigen::Matrix<double, 6, 6> Jlog;
      pin::Jlog6(E.inverse(), Jlog);
      Jd.noalias() = -Jlog * J;
      Eigen::Matrix<double, 6, 6> A = Jd * Jd.transpose();
      A.diagonal().array() += 1e-6;
      q.noalias() -= Jd.transpose() * A.ldlt().solve(e);
      q = q.cwiseMax(low).cwiseMin(high);
    }
    return false;
  }

  bool solve(Column &q, const Target &target, std::mt19937 &random) {
    std::uniform_real_distribution<double> part(0, 1);
    const auto start = std::chrono::steady_clock::now();
    do {
      if (descend(q, target)) return true;
      for (int k = 0; k < q.size(); k++) q[k] = low[k] + (high[k] - low[k]) * part(random);
    } while (std::chrono::steady_clock::now() - start < std::chrono::milliseconds(5));
    return false;
  }
};

static void time_inverse(const std::string &name, Clik clik, const std::vector<Target> &targets) {
  double mean = 1e99, late = 0;
  size_t reached = 0;
  for (int run = 0; run < 3; run++) {
    std::mt19937 random(7);
    std::vector<double> all;
    double sum = 0;
    reached = 0;
    for (const Target &target : targets) {
      Column q = target.start;
      const auto start = std::chrono::steady_clock::now();
      const bool found = clik.solve(q, target, random);
      all.push_back(std::chrono::duration<double, std::nano>(std::chrono::steady_clock::now() - start).count());
      sum += all.back();
      reached += found && Clik::reached(clik.error(q, target));
    }
    if (sum / all.size() < mean) {
      mean = sum / all.size();
      std::sort(all.begin(), all.end());
      late = all[all.size() * 99 / 100];
    }
  }
  std::printf("%s inverse-kinematics %.1f %.1f %zu\n", name.c_str(), mean, late, reached);
  std::fflush(stdout);
}

static Column column(int n) {
  Column x(n);
  for (int k = 0; k < n; k++) x[k] = number();
  return x;
}

int main() {
  const int models = int(number());
  for (int m = 0; m < models; m++) {
    std::string name;
    std::cin >> name;
    const pin::Model model = read_model();
    pin::Data data(model);
    const int n = model.nv;
    const auto end = model.getFrameId("end");
    const int postures = int(number());
    std::vector<Column> q(postures, Column(n)), v = q, a = q;
    for (int i = 0; i < postures; i++)
      for (auto *column : {&q[i], &v[i], &a[i]})
        for (int k = 0; k < n; k++) (*column)[k] = number();
    Eigen::Matrix<double, 6, Eigen::Dynamic> J(6, n);
    J.setZero();
    time(name, "pose", postures, [&](int i) {
      pin::forwardKinematics(model, data, q[i]);
      pin::updateFramePlacement(model, data, end);
      return data.oMf[end].translation().sum();
    });
    time(name, "jacobian", postures, [&](int i) {
      pin::computeFrameJacobian(model, data, q[i], end, pin::LOCAL_WORLD_ALIGNED, J);
      return J(0, 0) + J(5, n - 1) + J(1, n / 2);
    });
    time(name, "inverse-dynamics", postures, [&](int i) { pin::rnea(model, data, q[i], v[i], a[i]); return data.tau.sum(); });
    time(name, "gravity", postures, [&](int i) { pin::computeGeneralizedGravity(model, data, q[i]); return data.g.sum(); });
    const auto mass = [&](pin::Convention convention) {
      return [&, convention](int i) {
        pin::crba(model, data, q[i], convention);
        return data.M(0, 0) + data.M(0, n - 1) + data.M(n / 2, n / 2);
      };
    };
    time(name, "mass-matrix", postures, mass(pin::Convention::WORLD));
    time(name, "mass-matrix-local", postures, mass(pin::Convention::LOCAL));
    time(name, "com-jacobian", postures, [&](int i) {
      pin::jacobianCenterOfMass(model, data, q[i], false);
      return data.com[0].sum() + data.Jcom(0, 0) + data.Jcom(2, n - 1);
    });
    time(name, "forward-dynamics", postures, [&](int i) {
      pin::aba(model, data, q[i], v[i], a[i], pin::Convention::WORLD);
      return data.ddq[0];
    });
    time(name, "regressor", postures, [&](int i) {
      pin::computeJointTorqueRegressor(model, data, q[i], v[i], a[i]);
      return data.jointTorqueRegressor(0, 0) + data.jointTorqueRegressor(0, 10 * n - 1) + data.jointTorqueRegressor(n - 1, 10 * n - 4);
    });
    std::vector<Target> targets;
    targets.resize(size_t(number()));
    if (targets.empty()) continue;
    const Column low = column(n), high = column(n);
    for (Target &target : targets) {
      target.start = column(n);
      const Eigen::Matrix3d rotation = matrix();
      target.pose = pin::SE3(rotation, vector());
    }
    time_inverse(name, Clik{model, data, end, low, high, J, J}, targets);
  }
}
