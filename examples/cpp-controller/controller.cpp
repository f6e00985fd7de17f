// Two controllers on a generated torque model, each a function of some lines, and a simulated arm that they move. No hardware was
// run with them.

#include "simulated_arm.hpp"

#include <cstdio>

namespace {

// The weight: the torque of the arm at rest. Friction of a joint at rest is 0 and is left to the hand that moves it.
void weight(const SimulatedArm &arm, Joints &effort) { my_arm_gravity(arm.q.data(), effort.data()); }

// Computed torque: the acceleration that lets errors decay, through the whole model. Friction and effects are those of the
// velocity that is wanted: the sign of a measured one is noise at rest.
void follow(my_arm_model &model, const SimulatedArm &arm, const Joints &q, const Joints &dq, const Joints &ddq, Joints &effort) {
  constexpr double BANDWIDTH = 0.1 / PERIOD; // rad/s
  Joints acceleration;
  for (int j = 0; j < JOINTS; ++j) {
    acceleration[j] = ddq[j] + 2 * BANDWIDTH * (dq[j] - arm.dq[j]) + BANDWIDTH * BANDWIDTH * (q[j] - arm.q[j]);
  }
  my_arm_torque(&model, arm.q.data(), dq.data(), acceleration.data(), arm.time, nullptr, effort.data());
}

} // namespace

int main() {
  const Joints bent = {0.3, -0.6, 0.8, 0.4, -0.7, 0.2};
  SimulatedArm arm(bent);
  arm.rubs = false;
  for (int k = 0; k < 400; ++k) {
    weight(arm, arm.effort);
    arm.advance();
  }
  const double drift = distance(arm.q, bent);

  arm = SimulatedArm(bent);
  my_arm_model model;
  my_arm_start(&model);
  double worst = 0;
  for (int k = 0; k < 800; ++k) {
    Joints q = bent, dq, ddq;
    for (int j = 0; j < JOINTS; ++j) {
      q[j] += 0.2 - 0.2 * std::cos(2 * k * PERIOD);
      dq[j] = 0.4 * std::sin(2 * k * PERIOD);
      ddq[j] = 0.8 * std::cos(2 * k * PERIOD);
    }
    worst = std::fmax(worst, distance(arm.q, q));
    follow(model, arm, q, dq, ddq, arm.effort);
    arm.advance();
  }
  std::printf("held without friction for 2 s: %.1e rad; largest error along a path: %.2f mrad\n", drift, 1e3 * worst);
  return drift < 1e-6 && worst < 5e-3 ? 0 : 1;
}
