// What is good and what is not: the limits behind colours and warnings of a report.
#pragma once

#include "calib/poses/pose_network.h"
#include "calib/poses/pose_solution.h"
#include "calib/report/quality_report.h"

namespace silhouette {

enum class Grade { kUnknown, kGood, kFair, kBad };

// In a word, which is also the class of the page's style: good, fair, bad or unknown.
const char* NameOf(Grade grade);

Grade GradeOf(const HeldOutError& error);
Grade GradeOf(const Repeatability& repeatability, const PredictedError& predicted);
Grade GradeOf(const HalvesDifference& halves);
// `width`: of the image; masks have about a tenth of its pixels and fewer.
Grade GradeOf(const PredictedError& predicted, int width);
Grade GradeOfCoverage(const ReportView& view);
Grade GradeOfTilt(const ReportView& view);
// `expected`: what the held-out corners of both views let expect.
Grade GradeOfLines(const ReportPair& pair, const QualityReport& report);
Grade GradeOfChi2(double chi2_per_dof);
// The worst of a view's, and of the report's.
Grade GradeOf(const ReportView& view);
Grade GradeOf(const QualityReport& report);

// What the report's figures give reason to warn of, one sentence each.
std::vector<std::string> WarningsOf(const QualityReport& report);

}  // namespace silhouette
