// A plant that is watched, in C++17: a thin face of core/fb.h. No allocation, no exception, no input or output.
#ifndef FB_HPP
#define FB_HPP

#include <cstddef>
#include <cstdint>
#include <utility>

#if __cplusplus >= 202002L
#include <span>
#endif

#include "faultbond.h"

namespace faultbond {

#if __cplusplus >= 202002L
template <class Number> using Span = std::span<Number>;
#else
// Numbers that stand one after the other and belong to somebody else.
template <class Number> class Span {
public:
    constexpr Span(Number *first, std::size_t count) noexcept : first_(first), count_(count) {}
    template <std::size_t n> constexpr Span(Number (&all)[n]) noexcept : first_(all), count_(n) {}
    template <class Holder, class = decltype(std::declval<Holder &>().data()), class = decltype(std::declval<Holder &>().size())>
    constexpr Span(Holder &&holder) noexcept : first_(holder.data()), count_(holder.size()) {}
    constexpr Number *data() const noexcept { return first_; }
    constexpr std::size_t size() const noexcept { return count_; }
    constexpr Number *begin() const noexcept { return first_; }
    constexpr Number *end() const noexcept { return first_ + count_; }
    constexpr Number &operator[](std::size_t k) const noexcept { return first_[k]; }

private:
    Number *first_;
    std::size_t count_;
};
#endif

// What a decision led to.
enum class Decision : std::int64_t { refused = 0, taken = 1 };

// Watches one plant. It is as large as FB_STATE_BYTES and FB_WORK_BYTES together: keep it where there is room, not on a small stack.
// Monitors are independent of each other; one is one thread's at a time. A copy goes on from the same moment by itself.
class Monitor {
public:
    // time: of the beginning, s. quiet: no alarm is ever raised.
    explicit Monitor(double time = 0.0, bool quiet = false) noexcept { fb_init(state_, time, quiet ? 1 : 0); }

    // Take one sample: its time, s since the sample before, N_INPUTS inputs and N_OUTPUTS readings, SI, nan where one is missing. Gives
    // whether an alarm was raised, or a diagnosis is due: then `report()` tells which, and `found()` holds the diagnosis.
    bool step(double time, double since, Span<const double> inputs, Span<const double> readings) noexcept
    {
        double row[2 + N_INPUTS + N_OUTPUTS] = {time, since};
        for (std::size_t k = 0; k < N_INPUTS; k++) row[2 + k] = k < inputs.size() ? inputs[k] : NAN;
        for (std::size_t k = 0; k < N_OUTPUTS; k++) row[2 + N_INPUTS + k] = k < readings.size() ? readings[k] : NAN;
        return fb_step(state_, work_, row, &report_, &found_) != 0;
    }

    // Expect a sample after a time of unknown length.
    void resume() noexcept { fb_resume(state_); }

    // What the last sample brought.
    const Report &report() const noexcept { return report_; }

    // The diagnosis that was given last, and its candidates, the best first.
    const Diagnosis &found() const noexcept { return found_; }
    Span<const Candidate> candidates() const noexcept
    {
        return Span<const Candidate>(found_.candidates, static_cast<std::size_t>(found_.n_candidates));
    }

    // The diagnosis of now, after an alarm.
    const Diagnosis &diagnose() noexcept
    {
        fb_diagnosis(state_, work_, &found_);
        return found_;
    }

    // What to check next, after the diagnosis that was given last.
    Advice advise() noexcept
    {
        Advice advice;
        fb_advice(state_, work_, &found_, &advice);
        return advice;
    }

    // Take a hypothesis as the new healthy model, or as mended, or rule it out.
    Decision accept(std::int64_t hypothesis) noexcept { return decided(fb_accept(state_, work_, hypothesis, &candidate_)); }
    Decision repair(std::int64_t hypothesis) noexcept { return decided(fb_repair(state_, work_, hypothesis, &candidate_)); }
    Decision reject(std::int64_t hypothesis) noexcept { return decided(fb_reject(state_, work_, hypothesis, &candidate_)); }

    // All that is remembered, as FB_SAVED_BYTES bytes, the same on every machine; false where there is no room for them.
    bool save(Span<std::uint8_t> bytes) const noexcept
    {
        if (bytes.size() < FB_SAVED_BYTES) return false;
        fb_save(state_, bytes.data());
        return true;
    }

    // Go on from saved bytes; false where they are of another model or version, or damaged, and then it is as it was.
    bool restore(Span<const std::uint8_t> bytes) noexcept
    {
        return fb_restore(state_, bytes.data(), static_cast<std::int64_t>(bytes.size())) == 0;
    }

private:
    static Decision decided(std::int64_t refused) noexcept { return refused ? Decision::refused : Decision::taken; }

    FB_ALIGNED unsigned char state_[FB_STATE_BYTES];
    FB_ALIGNED unsigned char work_[FB_WORK_BYTES];
    Report report_{};
    Diagnosis found_{};
    Candidate candidate_{};
};

// The name of a suspect, as the model file has it.
inline const char *name(const Suspect &suspect) noexcept { return fb_suspect_name(&suspect); }

}  // namespace faultbond

#endif
