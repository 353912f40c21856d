/* Ends a minimisation by Ceres when what is left to gain is far below what the data can tell. */
#ifndef TACTUS_CONVERGED_HPP
#define TACTUS_CONVERGED_HPP

#include <ceres/iteration_callback.h>

#include <functional>
#include <utility>

namespace tactus
{

class Converged : public ceres::IterationCallback
{
  public:
	/* near: asked after every step that was taken. */
	explicit Converged(std::function<bool(const ceres::IterationSummary &)> n) : near(std::move(n))
	{
	}
	ceres::CallbackReturnType operator()(const ceres::IterationSummary &summary) override
	{
		return summary.step_is_successful && near(summary) ? ceres::SOLVER_TERMINATE_SUCCESSFULLY
														   : ceres::SOLVER_CONTINUE;
	}

  private:
	std::function<bool(const ceres::IterationSummary &)> near;
};

} // namespace tactus

#endif
