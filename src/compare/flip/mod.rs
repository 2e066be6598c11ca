//! FLIP, for what displays show and for radiance: Andersson et al. 2020, "FLIP: A Difference Evaluator for Alternating Images", and 2021, "Visualizing Errors in Rendered High Dynamic Range Images".
