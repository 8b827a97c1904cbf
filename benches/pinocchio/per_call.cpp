// Nanoseconds per call of Pinocchio's algorithms, and of the code that it generates from them, on one robot:
// what dynamics/benches/per_call.rs measures of ours, with the same states, rounds and sums.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include <pinocchio/codegen/cppadcg.hpp>

#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/frames.hpp>
#include <pinocchio/algorithm/regressor.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/codegen/cppadcg-algo.hpp>
#include <pinocchio/serialization.hpp>

using Eigen::VectorXd;

struct State {
    VectorXd q, v, a, all;
};

constexpr int STATES = 256, PASSES = 40, ROUNDS = 20;

static std::vector<State> states(int n) {
    std::vector<State> out;
    for (int k = 0; k < STATES; ++k) {
        State s{VectorXd(n), VectorXd(n), VectorXd(n), VectorXd(3 * n)};
        for (int j = 0; j < n; ++j) {
            s.q[j] = std::sin(0.7 * k + 1.3 * j);
            s.v[j] = std::cos(0.9 * k + 0.4 * j);
            s.a[j] = std::sin(1.1 * k - 0.6 * j);
        }
        s.all << s.q, s.v, s.a;
        out.push_back(s);
    }
    return out;
}

template <typename Call, typename Sum>
static void measure(const char *name, const std::vector<State> &states, Call call, Sum sum) {
    double fastest = INFINITY;
    for (int round = 0; round < ROUNDS; ++round) {
        auto begin = std::chrono::steady_clock::now();
        for (int pass = 0; pass < PASSES; ++pass)
            for (const State &s : states) {
                call(s);
                asm volatile("" ::: "memory");
            }
        double ns = std::chrono::duration<double, std::nano>(std::chrono::steady_clock::now() - begin).count();
        fastest = std::min(fastest, ns / (PASSES * STATES));
    }
    double squares = 0;
    for (const State &s : states) {
        call(s);
        squares += sum();
    }
    std::printf("%s %.2f %.9e\n", name, fastest, squares);
}

using Base = pinocchio::CodeGenBase<double>;

// What Pinocchio generates code for is `trace`, of the state's q, v and a.
template <typename Trace>
struct Generated : Base {
    Trace trace;
    Generated(const pinocchio::Model &model, int inputs, int outputs, const std::string &name, Trace trace)
        : Base(model, inputs, outputs, name, "generated_" + name), trace(trace) {
        build_jacobian = false;
    }
    void buildMap() override {
        CppAD::Independent(ad_X);
        trace(ad_model, ad_data, ad_X, ad_Y);
        ad_fun.Dependent(ad_X, ad_Y);
        ad_fun.optimize("no_compare_op");
    }
    double squares() const { return y.squaredNorm(); }
};

template <typename Trace>
static void generated(const char *name, const pinocchio::Model &model, int inputs, int outputs,
                      const std::vector<State> &states, Trace trace) {
    Generated<Trace> code(model, inputs, outputs, name, trace);
    code.initLib();
    // It takes one option, so that it is told of a file with options.
    code.loadLib(true, "/usr/bin/gcc", "@flags");
    std::vector<VectorXd> x;
    const std::string label = std::string("generated_") + name;
    measure(
        label.c_str(), states, [&](const State &s) { code.evalFunction(inputs == 3 * model.nv ? s.all : s.q); },
        [&] { return code.squares(); });
}

int main(int, char **argv) {
    pinocchio::Model model;
    // As text, so that no object of the library from PyPI is used, which was compiled with other alignments.
    model.loadFromText(argv[1]);
    pinocchio::Data data(model);
    const int n = model.nv;
    const auto all = states(n);
    const auto tip = static_cast<pinocchio::FrameIndex>(model.nframes - 1);
    const auto axes = pinocchio::LOCAL_WORLD_ALIGNED;
    Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(6, n);

    measure(
        "rnea", all, [&](const State &s) { pinocchio::rnea(model, data, s.q, s.v, s.a); },
        [&] { return data.tau.squaredNorm(); });
    measure(
        "regressor", all, [&](const State &s) { pinocchio::computeJointTorqueRegressor(model, data, s.q, s.v, s.a); },
        [&] { return data.jointTorqueRegressor.squaredNorm(); });
    measure(
        "jacobian", all,
        [&](const State &s) { pinocchio::computeFrameJacobian(model, data, s.q, tip, axes, jacobian); },
        [&] { return jacobian.squaredNorm(); });
    measure(
        "mass_matrix", all, [&](const State &s) { pinocchio::crba(model, data, s.q); },
        [&] {
            Eigen::MatrixXd whole = data.M.selfadjointView<Eigen::Upper>();
            return whole.squaredNorm();
        });

    generated("rnea", model, 3 * n, n, all, [n](auto &m, auto &d, auto &x, auto &y) {
        y = pinocchio::rnea(m, d, x.head(n), x.segment(n, n), x.tail(n));
    });
    generated("regressor", model, 3 * n, 10 * n * n, all, [n](auto &m, auto &d, auto &x, auto &y) {
        pinocchio::computeJointTorqueRegressor(m, d, x.head(n), x.segment(n, n), x.tail(n));
        y = Eigen::Map<const Base::ADVectorXs>(d.jointTorqueRegressor.data(), 10 * n * n);
    });
    generated("jacobian", model, n, 6 * n, all, [n, tip, axes](auto &m, auto &d, auto &x, auto &y) {
        Base::ADMatrixXs j = Base::ADMatrixXs::Zero(6, n);
        Base::ADVectorXs q = x;
        pinocchio::computeFrameJacobian(m, d, q, tip, axes, j);
        y = Eigen::Map<const Base::ADVectorXs>(j.data(), 6 * n);
    });
    generated("mass_matrix", model, n, n * n, all, [n](auto &m, auto &d, auto &x, auto &y) {
        Base::ADVectorXs q = x;
        pinocchio::crba(m, d, q);
        for (int i = 0; i < n; ++i)
            for (int j = 0; j < n; ++j) y[i * n + j] = d.M(std::min(i, j), std::max(i, j));
    });
}
