// What a controller manager does with the controller of my_arm, on a simulated arm: the generated model's forward dynamics with
// the friction and the effects of its torque model. Each expectation is of the arm's motion, none of the controller's numbers.
#include "my_arm_controller.hpp"
#include "simulated_arm.hpp"

#include <cmath>
#include <cstdlib>
#include <memory>

using hardware_interface::CommandInterface;
using hardware_interface::LoanedCommandInterface;
using hardware_interface::LoanedStateInterface;
using hardware_interface::StateInterface;
using CallbackReturn = controller_interface::CallbackReturn;
using return_type = controller_interface::return_type;

// What asks for memory is counted: the linker leads operator new, malloc and its kin here (--wrap).
static long allocations = 0;
extern "C" {
void * __real__Znwm(std::size_t size);
void * __real_malloc(std::size_t size);
void * __real_calloc(std::size_t count, std::size_t size);
void * __real_realloc(void * memory, std::size_t size);
int __real_posix_memalign(void ** memory, std::size_t alignment, std::size_t size);
void * __wrap__Znwm(std::size_t size) { return ++allocations, __real__Znwm(size); }
void * __wrap_malloc(std::size_t size) { return ++allocations, __real_malloc(size); }
void * __wrap_calloc(std::size_t count, std::size_t size) { return ++allocations, __real_calloc(count, size); }
void * __wrap_realloc(void * memory, std::size_t size) { return ++allocations, __real_realloc(memory, size); }
int __wrap_posix_memalign(void ** memory, std::size_t alignment, std::size_t size)
{
  return ++allocations, __real_posix_memalign(memory, alignment, size);
}
}

namespace
{
void expect(bool holds, const char * what)
{
  std::printf("%s: %s\n", holds ? "ok" : "WRONG", what);
  if (!holds) {
    std::exit(1);
  }
}

std::string joint(int j) { return "joint" + std::to_string(j + 1); }

// What a controller manager has: the hardware's handles, and those that the controller exports.
struct Manager
{
  MyArmController controller;
  std::vector<StateInterface::SharedPtr> external;
  std::vector<CommandInterface::SharedPtr> reference;
  const rclcpp_lifecycle::State state{};

  explicit Manager(const std::string & law, unsigned int rate = 200)
  {
    if (controller.init("torque", "", rate, "", rclcpp::NodeOptions()) != return_type::OK) {
      expect(false, "init");
    }
    std::vector<std::string> names;
    for (int j = 0; j < JOINTS; ++j) {
      names.push_back(joint(j));
    }
    set("joints", names);
    set("law", law);
    set("effort_limits", std::vector<double>{64, 64, 64, 64, 19, 19});
    set("effort_rate_limits", std::vector<double>(JOINTS, 5000.0));
  }

  void set(const std::string & name, const rclcpp::ParameterValue & value)
  {
    controller.get_node()->set_parameter(rclcpp::Parameter(name, value));
  }

  bool configure()
  {
    const long before = allocations;
    if (controller.on_configure(state) != CallbackReturn::SUCCESS) {
      return false;
    }
    if (allocations == before) {
      expect(false, "allocations are counted");
    }
    external = controller.export_state_interfaces();
    reference = controller.export_reference_interfaces();
    return true;
  }

  // In the order that the controller asks for; the last `fewer` states are not there.
  bool activate(SimulatedArm & arm, int fewer = 0)
  {
    std::vector<LoanedCommandInterface> commands;
    std::vector<LoanedStateInterface> states;
    for (int j = 0; j < JOINTS; ++j) {
      commands.emplace_back(std::make_shared<CommandInterface>(joint(j), "effort", &arm.effort[j]));
      states.emplace_back(std::make_shared<StateInterface>(joint(j), "position", &arm.q[j]));
      states.emplace_back(std::make_shared<StateInterface>(joint(j), "velocity", &arm.dq[j]));
    }
    states.erase(states.end() - fewer, states.end());
    controller.assign_interfaces(std::move(commands), std::move(states));
    return controller.on_activate(state) == CallbackReturn::SUCCESS;
  }

  return_type update()
  {
    const long before = allocations;
    const return_type done = controller.update(rclcpp::Time(), rclcpp::Duration::from_seconds(PERIOD));
    if (allocations != before) {
      expect(false, "a cycle asks for no memory");
    }
    return done;
  }

  // Cycles of a running controller.
  void run(SimulatedArm & arm, double seconds)
  {
    for (int k = 0; k < seconds / PERIOD; ++k) {
      if (update() != return_type::OK) {
        expect(false, "update");
      }
      arm.advance();
    }
  }
};

const Joints BENT = {0.3, -0.6, 0.8, 0.4, -0.7, 0.2};

void gravity_holds()
{
  Manager manager("gravity");
  expect(manager.configure(), "configure");
  expect(manager.external.size() == JOINTS && manager.external[1]->get_name() == "torque/joint2/external_effort" &&
    manager.reference.size() == 3 * JOINTS && manager.reference[8]->get_name() == "torque/joint3/velocity", "names");
  // Without friction, which would hold it by itself.
  SimulatedArm arm(BENT), alone(BENT);
  arm.rubs = alone.rubs = false;
  expect(manager.activate(arm), "activate");
  manager.run(arm, 2.0);
  expect(distance(arm.q, BENT) < 1e-6, "gravity compensation holds the arm without friction");
  for (int k = 0; k < 100; ++k) {
    alone.advance();
  }
  expect(distance(alone.q, BENT) > 0.1, "without it the arm falls");
  expect(manager.controller.on_deactivate(manager.state) == CallbackReturn::SUCCESS && arm.effort == Joints{},
    "deactivated it gives no torque");
}

// Half a cosine by `way` in two seconds, as a controller before this one writes it.
void swing(Manager & manager, SimulatedArm & arm, const Joints & from, double way, double & worst)
{
  const double rate = std::acos(-1.0) / 2.0;
  for (int k = 0; k <= 400; ++k) {
    const double t = k * PERIOD;
    Joints wanted{};
    for (int j = 0; j < JOINTS; ++j) {
      wanted[j] = from[j] + way * (1.0 - std::cos(rate * t)) / 2.0;
      manager.reference[j]->set_value(wanted[j]);
      manager.reference[JOINTS + j]->set_value(way * rate * std::sin(rate * t) / 2.0);
      manager.reference[2 * JOINTS + j]->set_value(way * rate * rate * std::cos(rate * t) / 2.0);
    }
    worst = std::fmax(worst, distance(arm.q, wanted));
    manager.run(arm, PERIOD);
  }
  for (int j = JOINTS; j < 3 * JOINTS; ++j) {
    manager.reference[j]->set_value(0.0);
  }
}

void computed_torque_follows_and_feels()
{
  Manager manager("computed_torque");
  expect(manager.configure(), "configure with the default bandwidth");
  SimulatedArm arm(BENT);
  expect(manager.activate(arm), "activate");
  manager.run(arm, 1.0);
  expect(distance(arm.q, BENT) < 1e-4, "alone it holds where it was activated");
  manager.controller.set_chained_mode(true);
  double worst = 0.0;
  swing(manager, arm, BENT, 0.4, worst);
  std::printf("    largest error on the way: %.2f mrad\n", 1e3 * worst);
  expect(worst < 5e-3, "computed torque follows within 5 mrad");
  manager.run(arm, 2.0);
  Joints goal = BENT;
  for (auto & x : goal) {
    x += 0.4;
  }
  expect(distance(arm.q, goal) < 1e-3, "and reaches the reference");

  // A hand pulls at joints 2 and 5.
  arm.push = {0.0, 8.0, 0.0, 0.0, -2.0, 0.0};
  manager.run(arm, 2.0);
  Joints seen{};
  for (int j = 0; j < JOINTS; ++j) {
    seen[j] = manager.external[j]->get_value();
  }
  std::printf("    external efforts: %.2f %.2f %.2f %.2f %.2f %.2f N m\n", seen[0], seen[1], seen[2], seen[3], seen[4], seen[5]);
  expect(distance(seen, arm.push) < 0.2, "the observer sees the torques that are applied, joint by joint");

  // What is no number: the reference holds, the state is refused and the last efforts stay.
  const Joints before = arm.q;
  manager.reference[0]->set_value(std::nan(""));
  manager.run(arm, 1.0);
  expect(distance(arm.q, before) < 1e-3, "a reference that is no number holds the arm");
  const Joints last = arm.effort;
  arm.dq[3] = std::nan("");
  expect(manager.update() == return_type::ERROR && arm.effort == last, "a state that is no number is refused");
  expect(!manager.activate(arm, 1) && !manager.activate(arm, 12), "too few states are refused");
  arm.q[2] = std::nan("");
  expect(!manager.activate(arm), "nor is it activated with a position that is no number");
}

bool configures(void (*change)(Manager &), unsigned int rate = 200)
{
  Manager manager("computed_torque", rate);
  change(manager);
  return manager.configure();
}

void wrong_parameters_are_refused()
{
  expect(configures([](Manager & m) { m.set("bandwidth", 20.0); }), "20 rad/s at 200 Hz");
  expect(!configures([](Manager & m) { m.set("bandwidth", 300.0); }), "gains that are unstable at the update rate are refused");
  expect(!configures([](Manager & m) { m.set("bandwidth", 20.0); }, 10), "and those that are so at a lower rate");
  expect(!configures([](Manager & m) { m.set("damping", -1.0); }), "a damping that is negative");
  expect(!configures([](Manager & m) { m.set("law", std::string("pid")); }), "a law that is none");
  expect(!configures([](Manager & m) { m.set("law", 1.0); }), "a parameter of another type");
  expect(!configures([](Manager & m) { m.set("joints", std::vector<std::string>{"joint1"}); }), "too few joints");
  expect(!configures([](Manager & m) { m.set("effort_limits", std::vector<double>(JOINTS, 0.0)); }), "no torque");
  expect(!configures([](Manager &) {}, 0), "an update rate that is not known");
}
}  // namespace

int main()
{
  gravity_holds();
  computed_torque_follows_and_feels();
  wrong_parameters_are_refused();
  return 0;
}
