// The dynamics of an arm as C code by CasADi, from Pinocchio's algorithms over CasADi's symbols.
//
//     pinocchio_casadi CHAIN.txt FOLDER
//
// Each line of CHAIN.txt is a revolute joint and the body after it: the axis (0, 1, 2 for x, y, z), the rotation (9 numbers, row by
// row) and the place (3) of the joint in the frame before it; mass, centre of mass (3) and inertia about it (xx xy yy xz yz zz).
// FOLDER/casadi.c gets the functions. Printed for each: its name, how many values it returns, its additions and multiplications,
// its divisions and all of CasADi's instructions.

#include <pinocchio/autodiff/casadi.hpp>

#include <pinocchio/algorithm/aba-derivatives.hpp>
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/regressor.hpp>
#include <pinocchio/algorithm/rnea-derivatives.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/multibody.hpp>

#include <fstream>
#include <iostream>

using casadi::SX;
using Model = pinocchio::ModelTpl<SX>;
using Data = pinocchio::DataTpl<SX>;
using Vector = Model::VectorXs;
using Matrix = Model::MatrixXs;
using Matrix3 = Eigen::Matrix<SX, 3, 3>;
using Vector3 = Eigen::Matrix<SX, 3, 1>;

static SX number(std::istream &in) {
    double value = 0;
    in >> value;
    return SX(value);
}

static bool add_joint(Model &model, std::istream &in) {
    int axis = 0;
    if (!(in >> axis)) return false;
    Matrix3 rotation;
    Vector3 place, centre;
    for (int k = 0; k < 9; ++k) rotation(k / 3, k % 3) = number(in);
    for (int k = 0; k < 3; ++k) place(k) = number(in);
    const SX mass = number(in);
    for (int k = 0; k < 3; ++k) centre(k) = number(in);
    Eigen::Matrix<SX, 6, 1> inertia;
    for (int k = 0; k < 6; ++k) inertia(k) = number(in);

    const pinocchio::SE3Tpl<SX> placement(rotation, place);
    const auto above = static_cast<pinocchio::JointIndex>(model.njoints - 1);
    const std::string name = "j" + std::to_string(model.njoints);
    pinocchio::JointIndex id = 0;
    if (axis == 0) id = model.addJoint(above, pinocchio::JointModelRevoluteTpl<SX, 0, 0>(), placement, name);
    if (axis == 1) id = model.addJoint(above, pinocchio::JointModelRevoluteTpl<SX, 0, 1>(), placement, name);
    if (axis == 2) id = model.addJoint(above, pinocchio::JointModelRevoluteTpl<SX, 0, 2>(), placement, name);
    model.appendBodyToJoint(id, pinocchio::InertiaTpl<SX>(mass, centre, pinocchio::Symmetric3Tpl<SX>(inertia)),
                            pinocchio::SE3Tpl<SX>::Identity());
    return true;
}

static Vector vector_of(const SX &symbols) {
    Vector result(symbols.rows());
    for (int i = 0; i < symbols.rows(); ++i) result(i) = symbols(i);
    return result;
}

// Row by row, as one column.
template <typename Derived>
static SX flat(const Eigen::MatrixBase<Derived> &values) {
    std::vector<SX> rows;
    for (int i = 0; i < values.rows(); ++i)
        for (int j = 0; j < values.cols(); ++j) rows.push_back(values(i, j));
    return SX::densify(SX::vertcat(rows));
}

// The derivatives by q and by dq as CasADi forms them of the values' expressions.
static SX derivatives(const SX &values, const SX &q, const SX &dq) {
    return SX::densify(SX::vertcat({SX::vec(SX::jacobian(values, q).T()), SX::vec(SX::jacobian(values, dq).T())}));
}

int main(int count, char **arguments) {
    if (count != 3) return 2;
    Model model;
    std::ifstream in(arguments[1]);
    while (add_joint(model, in)) {
    }
    const int n = model.nv;
    const SX q = SX::sym("q", n), dq = SX::sym("dq", n), last = SX::sym("last", n);
    const Vector position = vector_of(q), velocity = vector_of(dq), third = vector_of(last);
    std::vector<std::pair<std::string, SX>> results;
    const auto add = [&](const std::string &name, const SX &values) { results.emplace_back(name, values); };

    add("trigonometry", SX::vertcat({sin(q), cos(q)}));
    Data data(model);
    const SX torque = flat(pinocchio::rnea(model, data, position, velocity, third));
    add("inverse_dynamics", torque);
    add("regressor", flat(pinocchio::computeJointTorqueRegressor(model, data, position, velocity, third)));
    pinocchio::crba(model, data, position, pinocchio::Convention::LOCAL);
    Matrix mass = data.M;
    mass.triangularView<Eigen::StrictlyLower>() = data.M.transpose().triangularView<Eigen::StrictlyLower>();
    add("mass_matrix", flat(mass));
    add("coriolis_matrix", flat(pinocchio::computeCoriolisMatrix(model, data, position, velocity)));
    const Vector rest = Vector::Constant(n, SX(0));
    Model weightless = model;
    weightless.gravity.setZero();
    add("coriolis_times_velocity", flat(pinocchio::rnea(weightless, data, position, velocity, rest)));
    add("gravity", flat(pinocchio::computeGeneralizedGravity(model, data, position)));

    const Matrix zero = Matrix::Constant(n, n, SX(0));
    Matrix by_position = zero, by_velocity = zero, by_last = zero;
    pinocchio::computeRNEADerivatives(model, data, position, velocity, third, by_position, by_velocity, by_last);
    add("torque_derivatives", SX::vertcat({flat(by_position), flat(by_velocity)}));
    add("torque_jacobians", derivatives(torque, q, dq));
    const SX acceleration = flat(pinocchio::aba(model, data, position, velocity, third, pinocchio::Convention::LOCAL));
    add("forward_dynamics", acceleration);
    by_position = by_velocity = by_last = zero;
    Data fresh(model);
    pinocchio::computeABADerivatives(model, fresh, position, velocity, third, by_position, by_velocity, by_last);
    add("acceleration_derivatives", SX::vertcat({flat(by_position), flat(by_velocity)}));

    add("acceleration_jacobians", derivatives(acceleration, q, dq));

    casadi::CodeGenerator code("casadi.c");
    for (const auto &[name, values] : results) {
        const casadi::Function function(name, {q, dq, last}, {values}, {{"cse", true}});
        code.add(function);
        int operations = 0, divisions = 0;
        for (casadi_int k = 0; k < function.n_instructions(); ++k) {
            switch (function.instruction_id(k)) {
            case casadi::OP_ADD: case casadi::OP_SUB: case casadi::OP_MUL: case casadi::OP_SQ: case casadi::OP_TWICE:
                ++operations;
                break;
            case casadi::OP_DIV: case casadi::OP_INV: ++divisions; break;
            default: break;
            }
        }
        std::cout << name << ' ' << values.rows() << ' ' << operations << ' ' << divisions << ' ' << function.n_instructions() << '\n';
    }
    code.generate(std::string(arguments[2]) + "/");
    return 0;
}
