#include "arm_share.hpp"

#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

namespace catenary_ros2_control {

namespace {

void check(int code, const catenary_error &error) {
    if (code < 0) throw std::runtime_error(error.text);
}

}  // namespace

Quantity quantity_of(const std::string &interface) {
    if (interface == "position") return Quantity::position;
    if (interface == "velocity") return Quantity::velocity;
    if (interface == "effort") return Quantity::effort;
    throw std::invalid_argument("command interface '" + interface + "': must be position, velocity or effort");
}

ArmShare::ArmShare(std::string share, std::vector<std::string> axes, Quantity quantity, double lease)
    : share_name_(std::move(share)), names_(std::move(axes)), quantity_(quantity), duration_(lease) {
    const double unknown = std::numeric_limits<double>::quiet_NaN();
    for (auto *values : {&position, &velocity, &effort, &command}) values->assign(names_.size(), unknown);
}

ArmShare::~ArmShare() {
    close();
}

void ArmShare::open() {
    close();
    check(catenary_open(&share_, share_name_.c_str(), CATENARY_OWN_UID, 0, &error_), error_);
    row_.resize(catenary_row_size(share_));
    try {
        find_axes();
        position_ = field("position");
        velocity_ = field("velocity");
        effort_ = field("torque");
    } catch (...) {
        close();
        throw;
    }
}

void ArmShare::close() {
    deactivate();
    catenary_close(share_);
    share_ = nullptr;
    number_ = 0;
}

void ArmShare::activate() {
    if (share_ == nullptr) throw std::runtime_error("the share '" + share_name_ + "' is not open");
    command.assign(names_.size(), std::numeric_limits<double>::quiet_NaN());
    const auto count = static_cast<std::uint32_t>(axes_.size());
    check(catenary_lease_take(share_, axes_.data(), count, duration_, &lease_, &error_), error_);
}

void ArmShare::deactivate() {
    catenary_lease_release(lease_, &error_);
    lease_ = nullptr;
}

bool ArmShare::read() {
    std::uint64_t number = 0;
    if (share_ == nullptr || catenary_read(share_, row_.data(), row_.size(), &number, &error_) != CATENARY_OK) {
        return false;
    }
    if (number == number_ && catenary_wait(share_, number, 0.0, &error_) < 0) return false;
    number_ = number;
    for (std::size_t k = 0; k < axes_.size(); k++) {
        position[k] = catenary_value(position_, row_.data(), axes_[k]);
        velocity[k] = catenary_value(velocity_, row_.data(), axes_[k]);
        effort[k] = catenary_value(effort_, row_.data(), axes_[k]);
    }
    return true;
}

bool ArmShare::write() {
    if (lease_ == nullptr) return false;
    for (const double value : command) {
        if (!std::isfinite(value)) return catenary_lease_renew(lease_, &error_) == CATENARY_OK;
    }
    const double *position_command = quantity_ == Quantity::position ? command.data() : nullptr;
    const double *velocity_command = quantity_ == Quantity::velocity ? command.data() : nullptr;
    const double *torque_command = quantity_ == Quantity::effort ? command.data() : nullptr;
    return catenary_lease_send(lease_, position_command, velocity_command, torque_command, &error_) == CATENARY_OK;
}

void ArmShare::find_axes() {
    axes_.clear();
    for (const auto &name : names_) {
        const auto axis = catenary_find_axis(share_, name.c_str());
        if (axis < 0) throw std::runtime_error("the share '" + share_name_ + "' has no axis '" + name + "'");
        axes_.push_back(static_cast<std::uint32_t>(axis));
    }
}

const catenary_field *ArmShare::field(const char *name) const {
    const auto *found = catenary_find_field(share_, name);
    if (found == nullptr || found->per_axis == 0) {
        throw std::runtime_error("the share '" + share_name_ + "' has no field '" + name + "' with one number per axis");
    }
    return found;
}

}  // namespace catenary_ros2_control
