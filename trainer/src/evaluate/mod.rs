//! Quality, measured through the runtime: E_rms, STED, projections.
