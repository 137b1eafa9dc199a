// Run steps of ArmShare (examples/ros2_control) from standard input, one line each, and print results.
//
//     arm_driver SHARE QUANTITY LEASE AXIS ...
#include <cstdlib>
#include <exception>
#include <iostream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "arm_share.hpp"

using catenary_ros2_control::ArmShare;

static void print(const std::vector<double> &values) {
    for (const double value : values) std::cout << ' ' << value;
}

static void run(ArmShare &arm, const std::string &line) {
    std::istringstream words(line);
    std::string step;
    words >> step;
    if (step == "open") arm.open();
    else if (step == "close") arm.close();
    else if (step == "activate") arm.activate();
    else if (step == "deactivate") arm.deactivate();
    else if (step == "command") for (auto &value : arm.command) words >> value;
    else if (step == "write" && !arm.write()) throw std::runtime_error(arm.error());
    else if (step == "read") {
        if (!arm.read()) throw std::runtime_error(arm.error());
        std::cout << arm.cycle();
        print(arm.position);
        print(arm.velocity);
        print(arm.effort);
    }
}

int main(int count, char **words) {
    ArmShare arm(words[1], {words + 4, words + count}, catenary_ros2_control::quantity_of(words[2]), std::atof(words[3]));
    std::cout.precision(17);
    for (std::string line; std::getline(std::cin, line);) {
        try {
            run(arm, line);
            std::cout << std::endl;
        } catch (const std::exception &error) {
            std::cout << "error: " << error.what() << std::endl;
        }
    }
    return 0;
}
