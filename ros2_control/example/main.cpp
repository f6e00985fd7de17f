// What a controller manager does with the interface, on the bus of the first argument ("virtual" without one): its
// lifecycle, 1 s of a slow swing of joint 6, a jump that must be refused, and the way back from that error.
#include "powerball_system.hpp"

#include <cstdlib>

using hardware_interface::CallbackReturn;
using hardware_interface::return_type;

static void expect(bool true_, const char * what)
{
  std::printf("%s: %s\n", true_ ? "ok" : "WRONG", what);
  if (!true_) {
    std::exit(1);
  }
}

// A model by which joint 6 has no torque beyond 0.05 rad.
static void wall(void *, const double * position, const double *, const double *, double * torque)
{
  for (int j = 0; j < POWERBALL_JOINTS; ++j) {
    torque[j] = j == 5 && position[5] > 0.05 ? 1000.0 : 0.0;
  }
}

// The C functions alone, with a model of one's own: a slow motion of joint 6 ends where it has no torque.
static void own_model(const char * bus)
{
  powerball_arm * arm = powerball_open(bus, nullptr, 0);
  expect(powerball_guard_model(arm, "sideways", nullptr) == POWERBALL_ERROR, "a mounting that is none is refused");
  expect(powerball_guard_torque(arm, wall, nullptr) == POWERBALL_OK, "a model of one's own");
  expect(powerball_configure(arm) == POWERBALL_OK && powerball_activate(arm) == POWERBALL_OK, "the arm holds");
  double position[POWERBALL_JOINTS];
  powerball_read(arm, position, nullptr, nullptr);
  bool refused = false;
  while (!refused && position[5] < 0.1) {
    position[5] += 1e-4;
    refused = powerball_write(arm, position) == POWERBALL_ERROR;
    powerball_read(arm, nullptr, nullptr, nullptr);
  }
  expect(refused && std::fabs(position[5] - 0.05) < 2e-4, powerball_message(arm));
  powerball_close(arm);
}

int main(int count, char ** arguments)
{
  hardware_interface::HardwareInfo info;
  info.name = "powerball";
  info.hardware_parameters["bus"] = count > 1 ? arguments[1] : "virtual";
  for (int j = 1; j <= POWERBALL_JOINTS; ++j) {
    info.joints.push_back({"joint" + std::to_string(j)});
  }
  powerball::PowerballSystem arm;
  const rclcpp_lifecycle::State state;
  const rclcpp::Time time;
  const rclcpp::Duration period;
  expect(arm.on_init(info) == CallbackReturn::SUCCESS, "init");
  auto states = arm.export_state_interfaces();
  auto commands = arm.export_command_interfaces();
  expect(states.size() == 18 && commands.size() == 6, "18 states and 6 commands");
  expect(commands[5].get_name() == "joint6/position", "names");
  expect(arm.on_configure(state) == CallbackReturn::SUCCESS, "configure");
  expect(arm.on_activate(state) == CallbackReturn::SUCCESS, "activate");

  const double from = commands[5].get_value();
  double far = 0.0;
  for (int k = 0; k <= 200; ++k) {
    if (arm.read(time, period) != return_type::OK) {
      expect(false, "read");
    }
    far = std::fmax(far, states[15].get_value() - from);
    commands[5].set_value(from + 0.05 * (1.0 - std::cos(2.0 * M_PI * k / 200.0)));
    if (arm.write(time, period) != return_type::OK) {
      expect(false, "write");
    }
  }
  expect(std::fabs(far - 0.1) < 5e-3, "joint 6 has swung by 0.1 rad");

  commands[1].set_value(commands[1].get_value() + 0.5);
  bool stopped = false;
  for (int k = 0; k < 10 && !stopped; ++k) {
    stopped = arm.read(time, period) == return_type::ERROR;
    arm.write(time, period);
  }
  expect(stopped, "a jump of 0.5 rad is refused and stops the arm");
  expect(arm.on_error(state) == CallbackReturn::SUCCESS, "the arm stands");
  expect(arm.on_cleanup(state) == CallbackReturn::SUCCESS, "cleanup");

  own_model(info.hardware_parameters["bus"].c_str());
  return 0;
}
