// A generated torque model, called from C++.
//
// Reads one state a line, comma separated: q, dq, ddq of every joint and the seconds since the arm began to work; prints
// the torques. An empty line begins another path. Without a line it shows what holds the arm with every joint at 0.3 rad.

#include "my_arm.h"

#include <array>
#include <cstdio>
#include <iostream>
#include <sstream>
#include <string>

namespace {

constexpr int JOINTS = MY_ARM_JOINTS;
using Vector = std::array<my_arm_real, JOINTS>;

// As a controller has it: the model is a member, no memory is asked for in the loop.
class TorqueModel {
public:
  TorqueModel() { restart(); }
  void restart() { my_arm_start(&model_); }
  bool torque(const Vector &q, const Vector &dq, const Vector &ddq, my_arm_real running, Vector &out) {
    return my_arm_torque(&model_, q.data(), dq.data(), ddq.data(), running, nullptr, out.data()) == MY_ARM_OK;
  }

private:
  my_arm_model model_;
};

void print(const Vector &torque) {
  for (int j = 0; j < JOINTS; ++j) {
    std::printf(j + 1 < JOINTS ? "%.17g," : "%.17g\n", static_cast<double>(torque[j]));
  }
}

int fail(const char *what) {
  std::fprintf(stderr, "%s\n", what);
  return 1;
}

} // namespace

int main() {
  // Wrong use is reported.
  my_arm_model never_started = {};
  Vector zero{}, torque{};
  if (my_arm_torque(&never_started, zero.data(), zero.data(), zero.data(), 0, nullptr, torque.data()) != MY_ARM_NOT_STARTED) {
    return fail("a model that was not started gives torques");
  }
  if (my_arm_start(nullptr) != MY_ARM_NULL) {
    return fail("null is taken for a model");
  }

  TorqueModel model;
  bool read = false;
  for (std::string line; std::getline(std::cin, line);) {
    read = true;
    if (line.empty()) {
      model.restart();
      continue;
    }
    std::istringstream numbers(line);
    std::array<Vector, 3> state{};
    char comma;
    for (auto &signal : state) {
      for (auto &x : signal) {
        numbers >> x >> comma;
      }
    }
    my_arm_real running = 0;
    if (!(numbers >> running)) {
      return fail("a line is no state: q, dq, ddq of every joint and the time, separated by commas");
    }
    if (!model.torque(state[0], state[1], state[2], running, torque)) {
      return fail("the model gives no torque");
    }
    print(torque);
  }
  if (!read) {
    Vector leaning{};
    leaning.fill(0.3);
    if (!model.torque(leaning, zero, zero, 0, torque)) {
      return fail("the model gives no torque");
    }
    print(torque);
  }
  return 0;
}
