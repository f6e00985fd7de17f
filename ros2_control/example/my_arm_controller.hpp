// The controller of one arm: the functions of its generated header, my_arm.h.
#pragma once

#include "my_arm.h"
#include "torque_controller.hpp"

class MyArmController : public powerball::TorqueController
{
public:
  MyArmController()
  : TorqueController(
      {MY_ARM_JOINTS, my_arm_mass_matrix, my_arm_coriolis_times_velocity, my_arm_coriolis_transpose_times_velocity,
       my_arm_gravity, sizeof(my_arm_model), [](void * model) { return my_arm_start(static_cast<my_arm_model *>(model)); },
       [](void * model, const double * q, const double * dq, const double * ddq, double running,
          const double * temperature, double * torque) {
         return my_arm_torque(static_cast<my_arm_model *>(model), q, dq, ddq, running, temperature, torque);
       }})
  {
  }
};
