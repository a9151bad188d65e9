// SPDX-License-Identifier: Apache-2.0
// Values that the store's own functions would not write: what faults leave, or other programs.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "db/store/environment.h"
#include "db/store/schema.h"

namespace silhouette {

// Puts `change`, of the value of `from`, under `to` in a sub-database.
inline void PutRaw(const std::string& folder, const std::string& sub_database, uint64_t from,
                   uint64_t to, const std::function<std::string(const std::string&)>& change) {
  const auto environment = Environment::Open(folder);
  ASSERT_TRUE(environment.ok()) << environment.status();
  const MDB_dbi values = **(*environment)->Find(sub_database);
  const auto write = [&](WriteTransaction& transaction) {
    const schema::NumberKey from_key = schema::EncodeKey(from);
    const schema::NumberKey to_key = schema::EncodeKey(to);
    MDB_val key = ToVal({from_key.data(), from_key.size()});
    MDB_val stored;
    EXPECT_EQ(mdb_get(transaction.get(), values, &key, &stored), 0);
    return transaction.Put(values, {to_key.data(), to_key.size()},
                           change(std::string(FromVal(stored))));
  };
  ASSERT_TRUE((*environment)->Update(0, write).ok());
}

}  // namespace silhouette
