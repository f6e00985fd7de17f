// The arm of my_arm.h in time: its forward dynamics, with the friction and the effects of its torque model.
#pragma once

#include "my_arm.h"

#include <array>
#include <cmath>

constexpr int JOINTS = MY_ARM_JOINTS;
// Time between two cycles of a controller, s.
constexpr double PERIOD = 0.005;
using Joints = std::array<double, JOINTS>;

struct SimulatedArm {
  Joints q, dq{};
  // Of the motors, and from outside, N m.
  Joints effort{}, push{};
  bool rubs = true;
  double time = 0.0;
  my_arm_model model;

  explicit SimulatedArm(const Joints &from) : q(from) { my_arm_start(&model); }

  // A cycle later.
  void advance() {
    constexpr int STEPS = 50;
    const double h = PERIOD / STEPS;
    const Joints zero{};
    for (int step = 0; step < STEPS; ++step) {
      Joints whole{}, rigid{}, ddq{}, torque = effort;
      time += h;
      my_arm_torque(&model, q.data(), dq.data(), zero.data(), time, nullptr, whole.data());
      my_arm_inverse_dynamics(q.data(), dq.data(), zero.data(), rigid.data());
      for (int j = 0; j < JOINTS; ++j) {
        torque[j] += push[j] - (rubs ? whole[j] - rigid[j] : 0.0);
      }
      my_arm_forward_dynamics(q.data(), dq.data(), torque.data(), ddq.data());
      for (int j = 0; j < JOINTS; ++j) {
        dq[j] += ddq[j] * h;
        q[j] += dq[j] * h;
      }
    }
  }
};

// The largest difference of two joints, rad.
inline double distance(const Joints &a, const Joints &b) {
  double most = 0.0;
  for (int j = 0; j < JOINTS; ++j) {
    most = std::fmax(most, std::fabs(a[j] - b[j]));
  }
  return most;
}
